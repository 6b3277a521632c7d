"""Recovery: of a damaged or unfinished session file, and of its rings, all that is provably whole.

The input is only read. The result is written beside it under another name, read back by the
`mcap` package, synced and renamed; only then are the rings removed.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import SessionError, UsageError
from seamlog.files import check_output, replacing
from seamlog.limits import LIMITS
from seamlog.mcap import parsing, records
from seamlog.mcap.attachments import read_attachment
from seamlog.mcap.channel_course import iter_missing
from seamlog.mcap.chunks import read_chunk
from seamlog.mcap.heads import message_heads
from seamlog.mcap.index import FileIndex
from seamlog.mcap.message_index import index_count
from seamlog.mcap.records import ChunkEntry, Malformed
from seamlog.mcap.scan import scan
from seamlog.mcap.source import FileSource
from seamlog.progress import track
from seamlog.segments import PROBLEMS, RECORDING
from seamlog.session import open_session

from .accounts import Account
from .recovery_check import check_by_second_reader
from .recovery_file import RecoveredFile
from .recovery_rings import define_channels, drain, find_rings
from .recovery_tail import tail_messages
from .segment import part_of

END = "seamlog.recording.end"
_STATUS = "/seamlog/recorder"
_PART = ".mcap.part"
_SEGMENT = re.compile(r"(?P<stem>.+?)(?:\.(?P<number>\d{4,}))?\.mcap(?:\.part)?")


@dataclass(slots=True)
class ChannelRecovery:
    """What became of one channel; `lost` is None where nothing tells how much there was."""

    topic: str
    kept: int = 0
    from_rings: int = 0
    unproved: int = 0
    """Of the kept ones those that no CRC proved: open tail, messages outside chunks."""
    lost: int | None = None


@dataclass(slots=True)
class Recovery:
    """A recovery that was done; `problems` says in words what is missing."""

    source: Path
    output: Path
    channels: list[ChannelRecovery] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    rings: Path | None = None
    end_known: bool = True
    """The file reaches its own end, or summary or rings tell how much there was."""

    @property
    def is_complete(self) -> bool:
        """Nothing is missing, and that is known."""
        return self.end_known and not self.has_losses

    @property
    def has_losses(self) -> bool:
        """Something is known to be missing."""
        return bool(self.problems) or any(row.lost for row in self.channels)


def default_output(path: Path) -> Path:
    """`weld.mcap` for `weld.mcap.part`, else `weld.recovered.mcap` for `weld.mcap`."""
    if path.name.endswith(_PART):
        return path.with_name(path.name.removesuffix(".part"))
    return path.with_name(f"{path.stem}.recovered.mcap")


def recover(path: Path, output: Path | None = None, force: bool = False) -> Recovery:
    """Make a session of what is whole of `path` and of the rings of its recording.

    Where `path` is not there and `path` + `.part` is, that one is meant. Raises `SessionError` if
    nothing is whole, `UsageError` if it is still being recorded, `OutputExists`.
    """
    if not path.exists() and part_of(path).exists():
        path = part_of(path)
    target = output or default_output(path)
    if target.absolute() == path.absolute():
        raise UsageError(f"{path} is never changed; give another name with -o")
    check_output(target, force)
    return _Recovery(path, target).run(force)


class _Recovery:
    def __init__(self, path: Path, output: Path) -> None:
        self.result = Recovery(path, output)
        self._source, self._index = _opened(path)
        recording = _recording(self._source, self._index)
        rings = find_rings(path, recording.get("id"))
        self._rings = rings if rings and _is_last(path) else None
        if self._source is None and self._rings is None:
            raise SessionError(f"{path} holds nothing that is whole; there is nothing to recover")
        self._rows: dict[int, ChannelRecovery] = {}
        self._missing: dict[int, int] = {}
        self._last: dict[int, NDArray[Any]] = {}

    def run(self, force: bool) -> Recovery:
        result = self.result
        with replacing(result.output, force) as partial:
            with partial.open("xb", buffering=0) as raw:
                file = RecoveredFile(raw, self._index)
                if self._rings is not None:
                    define_channels(self._rings, file)
                self._copy(file)
                accounts = self._drain(file)
                self._count(accounts)
                self._sign(file)
                file.finish()
            if not file.counts and not self._index.attachments:
                raise SessionError(
                    f"{result.source} holds no message that is whole; there is nothing to recover"
                )
            check_by_second_reader(partial, file.counts)
        if self._rings is not None:
            self._rings.remove()
            result.rings = self._rings.folder
        if self._source is not None:
            self._source.close()
        return result

    def _copy(self, file: RecoveredFile) -> None:
        source, index = self._source, self._index
        if source is None:
            return
        entries = sorted(index.chunks, key=lambda entry: entry.offset)
        for entry in track(entries, "recovering", len(entries)):
            self._copy_chunk(file, source, entry)
        self._copy_tail(file, source)
        for attachment in index.attachments:
            try:
                read_attachment(source, attachment, LIMITS)
            except SessionError as error:
                self.result.problems.append(str(error))
            else:
                file.copy_attachment(source, attachment)
        for name, values in _metadata(source, index):
            file.add_metadata(name, values)

    def _copy_chunk(self, file: RecoveredFile, source: FileSource, entry: ChunkEntry) -> None:
        try:
            offsets, heads = message_heads(read_chunk(source, entry, LIMITS))
        except Malformed as error:
            self.result.problems.append(
                f"{source.path}: the chunk at byte {entry.offset} ({entry.length} bytes"
                f"{_held(source, entry, self._index)}) is damaged and was left out: {error}"
            )
            for number in entry.index_offsets:
                self._row(number)
            return
        file.copy_chunk(source, entry, offsets, heads)
        self._note(heads, proved=entry.compression != "bare" and _has_crc(source, entry))

    def _copy_tail(self, file: RecoveredFile, source: FileSource) -> None:
        gaps = self._index.gaps
        if not gaps or gaps[-1][1] != source.size:
            return
        tail = tail_messages(source, gaps[-1][0], LIMITS)
        if tail is None:
            return
        data, offsets, heads = tail
        wanted = np.isin(heads["channel"], list(file.known))
        if wanted.all():
            file.write_unproved(data, offsets, heads)
            self._note(heads, proved=False)

    def _note(self, heads: NDArray[Any], proved: bool) -> None:
        for number in np.unique(heads["channel"]).tolist():
            mine = heads[heads["channel"] == number]
            row = self._row(number)
            row.kept += len(mine)
            row.unproved += 0 if proved else len(mine)
            if number in self._last:
                mine = np.concatenate([self._last[number], mine])
            missing = sum(max(count, 0) for _, count in iter_missing(mine))
            self._missing[number] = self._missing.get(number, 0) + missing
            self._last[number] = mine[-1:].copy()

    def _row(self, number: int) -> ChannelRecovery:
        if number not in self._rows:
            channel = self._index.channels.get(number)
            topic = channel.topic if channel else f"/recovered/channel_{number}"
            self._rows[number] = ChannelRecovery(topic)
        return self._rows[number]

    def _drain(self, file: RecoveredFile) -> dict[int, Account]:
        if self._rings is None:
            return {}
        before = dict(file.counts)
        accounts = drain(self._rings, file, self._missing)
        for number, account in accounts.items():
            if number not in self._rows:
                self._rows[number] = ChannelRecovery(account.topic)
            row = self._rows[number]
            row.from_rings = file.counts.get(number, 0) - before.get(number, 0)
            row.kept += row.from_rings
        return accounts

    def _count(self, accounts: dict[int, Account]) -> None:
        """How many of each channel are lost, by summary, accounts or sequences."""
        index = self._index
        self.result.end_known = bool(index.expected or accounts) or index.reaches_end
        for number, row in sorted(self._rows.items()):
            self.result.channels.append(row)
            if number in index.expected:
                row.lost = max(0, index.expected[number] + row.from_rings - row.kept)
            elif number in accounts:
                row.lost = accounts[number].lost
            elif missing := self._missing.get(number):
                row.lost = max(0, missing - self._left_out(row.topic))
        for number, count in index.expected.items():
            if number not in self._rows and count:
                channel = index.channels.get(number)
                topic = channel.topic if channel else f"channel {number}"
                self.result.channels.append(ChannelRecovery(topic, lost=count))
        self.result.problems += [
            text for text in index.problems if index.gaps or index.left_out or "first bytes" in text
        ]

    def _left_out(self, topic: str) -> int:
        """Messages of a topic that were never to be in the file, by the last accounts readable."""
        with open_session(self.result.source) as session:
            if session.schema(_STATUS) is None:
                return 0
            columns = session.columns(_STATUS)
        mine = np.flatnonzero([name == topic for name in columns["topic"]])
        names = [name for name in ("dropped", "discarded") if name in columns]
        return sum(int(columns[name][mine].max(initial=0)) for name in names)

    def _sign(self, file: RecoveredFile) -> None:
        names = {name for name, _ in _metadata(self._source, self._index)}
        if END not in names and self._rings is not None:
            file.add_metadata(END, {"ending": "loop and recorder died"})
        elif END not in names and RECORDING in names:
            file.add_metadata(END, {"ending": "the end of the file is missing"})
        if self.result.has_losses:
            lost = [f"{row.topic}: {row.lost} lost" for row in self.result.channels if row.lost]
            texts = [*self.result.problems, *lost]
            file.add_metadata(PROBLEMS, {f"{i:03d}": text for i, text in enumerate(texts[:200])})


def _opened(path: Path) -> tuple[FileSource | None, FileIndex]:
    """The file and what a walk over it finds; none where it holds nothing whole."""
    try:
        source = FileSource(path)
    except SessionError:
        return None, FileIndex()
    try:
        return source, scan(source, f"{path} was walked over", LIMITS)
    except SessionError:
        source.close()
        return None, FileIndex()


def _recording(source: FileSource | None, index: FileIndex) -> dict[str, str]:
    return dict(_metadata(source, index)).get(RECORDING, {})


def _metadata(source: FileSource | None, index: FileIndex) -> Iterator[tuple[str, dict[str, str]]]:
    if source is None:
        return
    for entry in index.metadata:
        try:
            yield parsing.parse_metadata(
                source.content(entry.offset, entry.length, records.METADATA)
            )
        except Malformed:
            continue


def _held(source: FileSource, entry: ChunkEntry, index: FileIndex) -> str:
    counts = {number: index_count(source, entry, number) for number in entry.index_offsets}
    names = {number: row.topic for number, row in index.channels.items()}
    known = [f"{count} of {names.get(n, n)}" for n, count in counts.items() if count]
    return f", {', '.join(known)}" if known else ""


def _has_crc(source: FileSource, entry: ChunkEntry) -> bool:
    at = entry.offset + records.RECORD_HEAD.size + 24
    return any(source.data[at : at + 4])


def _is_last(path: Path) -> bool:
    """Rings belong behind the last file of a recording."""
    own, number = _numbered(path)
    others = (_numbered(other) for other in path.parent.glob("*.mcap*"))
    return number >= max((n for stem, n in others if stem == own), default=number)


def _numbered(path: Path) -> tuple[str, int]:
    match = _SEGMENT.fullmatch(path.name)
    return (match["stem"], int(match["number"] or 1)) if match else (path.name, 1)
