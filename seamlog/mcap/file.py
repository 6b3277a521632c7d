"""One MCAP file as a whole: its table of contents, its chunks, columns of its channels."""

import gc
import logging
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import SessionError, UnknownName
from seamlog.limits import LIMITS, Limits
from seamlog.mcap import parsing, records
from seamlog.mcap.chunks import read_chunk
from seamlog.mcap.columns import LOG_TIME, STAMP, ChannelDecoder, Columns, Wish, wish
from seamlog.mcap.decoders import Decoder, decoder_of
from seamlog.mcap.index import FileIndex, load_index
from seamlog.mcap.message_index import all_offsets, plausible_places
from seamlog.mcap.one_by_one import columns_one_by_one
from seamlog.mcap.records import ChannelRecord, ChunkEntry, Malformed
from seamlog.mcap.rows import Chunk, iter_batches, walk_messages
from seamlog.mcap.shapes import Forms, Grammar
from seamlog.mcap.source import FileSource

_LOG = logging.getLogger("seamlog")
ENDLESS = (0, 1 << 64)
"""The window that holds every log time."""
_FEW_STEPS = 100
"""More steps back than this are no clock that was set but times that were never in order."""
_STAMPS = ("header.stamp", "stamp", "timestamp")
_PARTS = (("sec", "nanosec"), ("seconds", "nanos"), ("secs", "nsecs"), ("sec", "nsec"))
"""Names of seconds and nanoseconds: ROS 2, protobuf, ROS 1, and Foxglove's JSON."""


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

    def decoder(self, channel: ChannelRecord) -> Decoder:
        """What decodes the messages of a channel; `SessionError` if nothing does."""
        schema = self.index.schemas.get(channel.schema_id)
        return decoder_of(channel, schema, f"{self.path}: {channel.topic}")

    def columns(
        self,
        channel: ChannelRecord,
        fields: Sequence[str] | None = None,
        window: tuple[int, int] = ENDLESS,
    ) -> Columns:
        """Columns of one channel in file order, `log_time_ns` first."""
        entries = self.entries(channel.id, window)
        decoder = self.decoder(channel)
        try:
            with _without_collection():
                columns = self._decoded(channel, entries, decoder, fields)
        except Malformed as error:
            raise SessionError(
                f"{self.path}: {channel.topic}: a message does not fit its definition: {error}"
            ) from error
        self._check_count(channel, len(columns[LOG_TIME]), window)
        return _within(_with_stamp(columns, fields), window)

    def _decoded(
        self,
        channel: ChannelRecord,
        entries: list[ChunkEntry],
        decoder: Decoder,
        fields: Sequence[str] | None,
    ) -> Columns:
        batches = iter_batches(self.iter_chunks(entries), channel.id)
        if not isinstance(decoder, Grammar):
            found = columns_one_by_one(batches, decoder, self.limits)
            return _picked(found, fields, channel.topic)
        wishes = _wishes(decoder.forms, fields, channel.topic)
        hint = self._hint(channel.id, entries)
        channel_decoder = ChannelDecoder(decoder, wishes, self.limits, hint)
        for batch in batches:
            channel_decoder.add(batch)
        return channel_decoder.columns()

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

    def kept_order(self, channel: ChannelRecord, columns: Columns, window: tuple[int, int]) -> bool:
        """Whether the clock stepped back while the channel was captured, so that order must stay.

        It did if log times fall back now and then while sequence numbers go on; then it is noted.
        Times that are merely jumbled are left to be sorted.
        """
        times = columns[LOG_TIME]
        back = np.flatnonzero(np.diff(times) < 0)
        if not len(back) or len(back) > len(times) // 20 or len(back) > _FEW_STEPS:
            return False
        batches = iter_batches(self.iter_chunks(self.entries(channel.id, window)), channel.id)
        sequences = np.concatenate([batch.sequences() for batch in batches])
        if not (sequences[1:] > sequences[:-1]).all():
            return False
        step = int(times[back[0]] - times[back[0] + 1]) * 1e-9
        self.note(
            f"{self.path}: {channel.topic}: the recorder's clock stepped back {len(back)} times, "
            f"first by {step:.3g} s behind {times[back[0]]} ns; messages stay in the order of "
            "their capture"
        )
        return True

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


@contextmanager
def _without_collection() -> Iterator[None]:
    """Millions of fresh objects make the garbage collector look at all of them, for nothing."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _wishes(forms: Forms, fields: Sequence[str] | None, topic: str) -> list[Wish]:
    if fields is None:
        return [Wish(name, name) for name in forms]
    asked = dict.fromkeys(name for name in fields if name not in (LOG_TIME, STAMP))
    found = {name: wish(name, forms) for name in asked}
    _raise_unknown([name for name, wished in found.items() if wished is None], forms, topic)
    stamps = [STAMP, *(f"{stamp}.{part}" for stamp in _STAMPS for pair in _PARTS for part in pair)]
    found |= {name: Wish(name, name) for name in stamps if name in forms}
    return [wished for wished in found.values() if wished is not None]


def _picked(columns: Columns, fields: Sequence[str] | None, topic: str) -> Columns:
    if fields is not None:
        asked = [name for name in fields if name not in (LOG_TIME, STAMP)]
        _raise_unknown([name for name in asked if name not in columns], columns, topic)
    return columns


def _raise_unknown(unknown: list[str], known: Iterable[str], topic: str) -> None:
    if unknown:
        raise UnknownName(
            f"{topic} has no field {', '.join(unknown)}; it has: {', '.join(sorted(known))}"
        )


def _with_stamp(columns: Columns, fields: Sequence[str] | None) -> Columns:
    pairs = ((f"{stamp}.{one}", f"{stamp}.{two}") for stamp in _STAMPS for one, two in _PARTS)
    found = next((pair for pair in pairs if set(pair) <= columns.keys()), None)
    if STAMP not in columns and found:
        seconds, rest = (columns[name] for name in found)
        if seconds.dtype.kind in "iu" and rest.dtype.kind in "iu":
            stamps = seconds.astype(np.int64)
            stamps *= 1_000_000_000
            stamps += rest.view(f"i{rest.itemsize}") if rest.itemsize == 8 else rest
            columns[STAMP] = stamps
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
