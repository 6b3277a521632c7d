"""One MCAP file as a whole: its table of contents, its chunks, columns of its channels."""

import logging
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import SessionError, UnknownName
from seamlog.limits import LIMITS, Limits
from seamlog.mcap import parsing, records
from seamlog.mcap.chunks import read_chunk
from seamlog.mcap.columns import LOG_TIME, STAMP, ChannelDecoder, Columns, column_forms
from seamlog.mcap.index import FileIndex, load_index
from seamlog.mcap.json_columns import json_columns
from seamlog.mcap.message_index import all_offsets, plausible_places
from seamlog.mcap.records import ChannelRecord, ChunkEntry, Malformed
from seamlog.mcap.ros2msg import DefinitionError, Node, parse
from seamlog.mcap.rows import Chunk, iter_batches, walk_messages
from seamlog.mcap.source import FileSource

_LOG = logging.getLogger("seamlog")
ENDLESS = (0, 1 << 64)
"""The window that holds every log time."""
_STAMPS = ("header.stamp", "stamp")


class McapFile:
    """A file opened for reading; `problems` grows when damage is met."""

    def __init__(self, path: Path, limits: Limits = LIMITS) -> None:
        self.path, self.limits = path, limits
        self.source = FileSource(path)
        try:
            self.index: FileIndex = load_index(self.source, limits)
        except BaseException:
            self.source.close()
            raise
        self.index.chunks.sort(key=lambda entry: entry.offset)
        self.problems = self.index.problems

    def channels(self, topic: str) -> list[ChannelRecord]:
        """The channels of `topic`, one per producer."""
        return [row for row in self.index.channels.values() if row.topic == topic]

    def entries(self, channel_id: int, window: tuple[int, int] = ENDLESS) -> list[ChunkEntry]:
        """Chunks that may hold messages of the channel in the half-open window, in file order."""
        start, end = window
        mine = self._by_channel.get(channel_id, self._unindexed)
        if window == ENDLESS:
            return list(mine)
        return [entry for entry in mine if entry.end_ns >= start and entry.start_ns < end]

    @cached_property
    def _unindexed(self) -> list[ChunkEntry]:
        return [entry for entry in self.index.chunks if not entry.index_offsets]

    @cached_property
    def _by_channel(self) -> dict[int, list[ChunkEntry]]:
        found: dict[int, list[ChunkEntry]] = {}
        for entry in self.index.chunks:
            for channel_id in entry.index_offsets or self.index.channels:
                found.setdefault(channel_id, []).append(entry)
        return found

    def iter_chunks(self, entries: Iterable[ChunkEntry]) -> Iterator[Chunk]:
        """Unpacked, proved chunks; a damaged one is left out and noted as a problem."""
        for entry in entries:
            try:
                chunk = read_chunk(self.source, entry, self.limits)
            except Malformed as error:
                self.note(
                    f"{self.path}: the chunk at byte {entry.offset} ({entry.length} bytes) is "
                    f"damaged and was left out: {error}"
                )
                continue
            yield Chunk(chunk, partial(all_offsets, self.source, entry))

    def note(self, problem: str) -> None:
        """Remember a problem, once, and warn."""
        if problem not in self.problems:
            self.problems.append(problem)
            _LOG.warning("%s", problem)

    def definition(self, channel: ChannelRecord) -> tuple[Node, ...]:
        """Fields of the messages of a CDR channel; `SessionError` if they cannot be decoded."""
        schema = self.index.schemas.get(channel.schema_id)
        where = f"{self.path}: {channel.topic}"
        if schema is None or schema.encoding != "ros2msg":
            found = schema.encoding if schema else "no"
            raise SessionError(
                f"{where} has a message definition in {found} form; only ros2msg and JSON are "
                "decoded so far: convert the file, for example with a ros2 bag tool"
            )
        try:
            return parse(schema.name, schema.data.decode())
        except (DefinitionError, UnicodeDecodeError) as error:
            raise SessionError(
                f"{where}: the definition of {schema.name} cannot be read: {error}"
            ) from error

    def columns(
        self,
        channel: ChannelRecord,
        fields: Sequence[str] | None = None,
        window: tuple[int, int] = ENDLESS,
    ) -> Columns:
        """Columns of one channel in file order, `log_time_ns` first."""
        entries = self.entries(channel.id, window)
        batches = iter_batches(self.iter_chunks(entries), channel.id)
        try:
            if channel.message_encoding == "json":
                columns = _picked(json_columns(batches), fields, channel.topic)
            else:
                nodes = self._cdr_definition(channel)
                names = _wanted(nodes, fields, channel.topic)
                hint = self._hint(channel.id, entries)
                decoder = ChannelDecoder(nodes, names, self.limits, hint)
                for batch in batches:
                    decoder.add(batch)
                columns = decoder.columns()
        except Malformed as error:
            raise SessionError(
                f"{self.path}: {channel.topic}: a message does not fit its definition: {error}"
            ) from error
        self._check_count(channel, len(columns[LOG_TIME]), window)
        return _within(_with_stamp(columns, fields), window)

    def _cdr_definition(self, channel: ChannelRecord) -> tuple[Node, ...]:
        if channel.message_encoding != "cdr":
            raise SessionError(
                f"{self.path}: {channel.topic} is encoded as {channel.message_encoding!r}; cdr "
                "and json are decoded so far: convert the file to one of them"
            )
        return self.definition(channel)

    def _hint(self, channel_id: int, entries: list[ChunkEntry]) -> int:
        room = sum(min(e.uncompressed_size, self.limits.chunk_bytes) for e in entries) // 31
        return min(self.index.statistics.channel_counts.get(channel_id, 0), room)

    def _check_count(self, channel: ChannelRecord, count: int, window: tuple[int, int]) -> None:
        expected = self.index.statistics.channel_counts.get(channel.id, count)
        if window == ENDLESS and count != expected:
            self.note(
                f"{self.path}: {channel.topic} holds {count} readable messages where the summary "
                f"counts {expected}"
            )

    def message_places(self, entry: ChunkEntry, channel_id: int) -> list[tuple[int, int]]:
        """Log time and offset in the unpacked chunk of each message of the channel."""
        places = plausible_places(self.source, entry, channel_id)
        if places is not None:
            return places
        return [
            (int.from_bytes(chunk.data[offset + 15 : offset + 23], "little"), offset)
            for chunk in self.iter_chunks([entry])
            for offset in walk_messages(chunk.data, channel_id)[0].tolist()
        ]

    def log_times_ns(self, channel: ChannelRecord, window: tuple[int, int]) -> NDArray[np.int64]:
        """Log times of the channel's messages inside the window, from the message indexes."""
        start, end = window
        entries = self.entries(channel.id, window)
        times = [t for entry in entries for t, _ in self.message_places(entry, channel.id)]
        return np.array([time for time in times if start <= time < end], np.int64)

    @cached_property
    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Metadata records by name; a damaged one is noted."""
        return list(self._read_metadata())

    def _read_metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        for entry in self.index.metadata:
            try:
                content = self.source.content(entry.offset, entry.length, records.METADATA)
                yield parsing.parse_metadata(content)
            except Malformed as error:
                self.note(
                    f"{self.path}: metadata {entry.name!r} at byte {entry.offset} is damaged "
                    f"and was left out: {error}"
                )

    def close(self) -> None:
        """Close the file."""
        self.source.close()


def _wanted(nodes: tuple[Node, ...], fields: Sequence[str] | None, topic: str) -> list[str]:
    known = list(column_forms(nodes))
    if fields is None:
        return known
    asked = [name for name in fields if name not in (LOG_TIME, STAMP)]
    _check_names(asked, known, topic)
    stamps = [STAMP] + [f"{stamp}.{part}" for stamp in _STAMPS for part in ("sec", "nanosec")]
    return [name for name in known if name in asked or name in stamps]


def _picked(columns: Columns, fields: Sequence[str] | None, topic: str) -> Columns:
    if fields is not None:
        _check_names([n for n in fields if n not in (LOG_TIME, STAMP)], list(columns), topic)
    return columns


def _check_names(asked: list[str], known: list[str], topic: str) -> None:
    unknown = [name for name in asked if name not in known]
    if unknown:
        raise UnknownName(
            f"{topic} has no field {', '.join(unknown)}; it has: {', '.join(sorted(known))}"
        )


def _with_stamp(columns: Columns, fields: Sequence[str] | None) -> Columns:
    if STAMP not in columns:
        for stamp in _STAMPS:
            seconds, rest = columns.get(f"{stamp}.sec"), columns.get(f"{stamp}.nanosec")
            if seconds is not None and rest is not None:
                columns[STAMP] = seconds.astype(np.int64) * 1_000_000_000 + rest
                break
    if fields is None:
        return columns
    kept = (LOG_TIME, STAMP, *fields)
    return {name: column for name, column in columns.items() if name in kept}


def _within(columns: Columns, window: tuple[int, int]) -> Columns:
    if window == ENDLESS:
        return columns
    times = columns[LOG_TIME]
    inside = (times >= max(window[0], 0)) & (times < min(window[1], (1 << 63) - 1))
    return columns if inside.all() else {name: c[inside] for name, c in columns.items()}
