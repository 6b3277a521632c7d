"""Where the messages of one channel lie in unpacked chunks, proved byte by byte, never assumed.

Nothing here trusts a message index: rows come from the chunk itself, which its CRC has proved.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

from seamlog.mcap import records
from seamlog.mcap.records import Malformed

PAYLOAD = 31
"""Bytes of a Message record in front of its payload."""
_HEAD = records.RECORD_HEAD
_JOIN_BYTES = 1 << 20
_MERGE_BYTES = 4 << 20
_START = np.dtype([("opcode", "u1"), ("length", "<u8"), ("channel", "<u2")])
"""How a Message record begins."""
Places: TypeAlias = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Offsets and whole lengths of messages."""


@dataclass(frozen=True, slots=True)
class Rows:
    """`count` Message records of one length: `stride` bytes apart in `data` from `start` on."""

    data: NDArray[np.uint8]
    start: int
    stride: int
    count: int
    length: int
    """Bytes of one whole record."""

    def column(self, offset: int, form: str, count: int | None = None) -> NDArray[Any]:
        """View of a value (or `count` values) at `offset` of each record's payload."""
        kind = np.dtype(form)
        at = self.start + PAYLOAD + offset
        if count is None:
            return np.ndarray((self.count,), kind, self.data, at, (self.stride,))
        shape, strides = (self.count, count), (self.stride, kind.itemsize)
        return np.ndarray(shape, kind, self.data, at, strides)

    def log_times_ns(self) -> NDArray[np.int64]:
        """Log time of each record."""
        return self.column(15 - PAYLOAD, "<i8")

    def select(self, chosen: NDArray[np.bool_]) -> "Rows":
        """The chosen records, copied."""
        whole = np.ndarray((self.count,), f"V{self.length}", self.data, self.start, (self.stride,))[
            chosen
        ]
        return Rows(whole.view(np.uint8), 0, self.length, len(whole), self.length)


@dataclass(frozen=True, slots=True)
class Chunk:
    """An unpacked, proved chunk.

    `message_offsets` gives the offsets of all messages by its message indexes, in order, None if
    it has none; they are not proved.
    """

    data: memoryview
    message_offsets: Callable[[], NDArray[np.int64] | None]


@dataclass(frozen=True, slots=True)
class Batch:
    """Messages of one channel in file order.

    `uniform` holds them all where they follow each other and have one length; else there are the
    `offsets` and whole `lengths` of their records in `data`.
    """

    data: NDArray[np.uint8]
    uniform: Rows | None
    offsets: NDArray[np.int64]
    lengths: NDArray[np.int64]

    @property
    def count(self) -> int:
        """How many messages there are."""
        return self.uniform.count if self.uniform else len(self.offsets)

    def groups(self) -> Iterator[tuple[Rows, NDArray[np.int64] | None]]:
        """Rows of each length and their positions in the batch (None: all of it)."""
        if self.uniform:
            yield self.uniform, None
            return
        lengths, found = _distinct(self.lengths)
        for length in found:
            places = np.flatnonzero(lengths == length)
            rows = _gather(self.data, self.offsets[places], length)
            yield rows, None if len(places) == len(self.offsets) else places

    def places(self) -> Places:
        """Offsets and whole lengths of all messages."""
        if self.uniform is None:
            return self.offsets, self.lengths
        rows = self.uniform
        steps = np.arange(rows.count, dtype=np.int64) * rows.stride
        return rows.start + steps, np.full(rows.count, rows.length, np.int64)

    def payloads(self) -> Iterator[tuple[int, memoryview]]:
        """Log time and payload of each message."""
        data = self.data.data
        for at, length in zip(*(part.tolist() for part in self.places()), strict=True):
            time = int.from_bytes(data[at + 15 : at + 23], "little", signed=True)
            yield time, data[at + PAYLOAD : at + length]

    def sequences(self) -> NDArray[np.uint32]:
        """Sequence number of each message."""
        return self._heads(11, "<u4")

    def log_times_ns(self) -> NDArray[np.int64]:
        """Log time of each message."""
        return self._heads(15, "<i8")

    def _heads(self, at: int, form: str) -> NDArray[Any]:
        if self.uniform:
            return self.uniform.column(at - PAYLOAD, form)
        kind = np.dtype(form)
        return taken(self.data, self.offsets + at, kind)


def _distinct(lengths: NDArray[np.int64]) -> tuple[NDArray[Any], list[int]]:
    """Lengths, in 16 bits where they fit, and which there are; counting is faster than sorting."""
    if lengths.max(initial=0) >= 1 << 16:
        return lengths, np.unique(lengths).tolist()
    return lengths.astype(np.uint16), np.flatnonzero(np.bincount(lengths)).tolist()


_NO_PLACES: Places = (np.zeros(0, np.int64), np.zeros(0, np.int64))


def iter_batches(chunks: Iterable[Chunk], channel_id: int) -> Iterator[Batch]:
    """Batches of a channel's messages in file order."""
    waiting: list[Batch] = []
    for batch in _batches(chunks, channel_id):
        size = len(batch.data)
        if size < _MERGE_BYTES // 2 and 2 * int(batch.lengths.sum()) > size:
            waiting.append(batch)
            if sum(len(part.data) for part in waiting) < _MERGE_BYTES:
                continue
            batch = _merged(waiting)
        elif waiting:
            yield _merged(waiting)
        yield batch
        waiting = []
    if waiting:
        yield _merged(waiting)


def _merged(parts: list[Batch]) -> Batch:
    """One batch out of several that hold little but messages of varying length.

    There are as many calls of numpy for a batch as there are shapes in it, whatever its size.
    """
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *(len(part.data) for part in parts[:-1])])
    offsets = [part.offsets + start for part, start in zip(parts, starts, strict=True)]
    lengths = np.concatenate([part.lengths for part in parts])
    data = np.concatenate([part.data for part in parts])
    return Batch(data, None, np.concatenate(offsets), lengths)


def _batches(chunks: Iterable[Chunk], channel_id: int) -> Iterator[Batch]:
    """Small chunks are joined before they are looked at."""
    parts: list[memoryview] = []
    size, lead = 0, b""
    for chunk in chunks:
        if len(chunk.data) > _JOIN_BYTES // 2:
            if parts:
                yield _batch(_joined(parts), channel_id, None)
                parts, size = [], 0
            yield _batch(chunk.data, channel_id, chunk)
            continue
        if not lead or chunk.data[: len(lead)] != lead:
            lead = bytes(chunk.data[: _lead_size(chunk.data)])
        parts.append(chunk.data[len(lead) :])
        size += len(parts[-1])
        if size > _JOIN_BYTES:
            yield _batch(_joined(parts), channel_id, None)
            parts, size = [], 0
    if parts:
        yield _batch(_joined(parts), channel_id, None)


def _joined(parts: list[memoryview]) -> memoryview:
    return parts[0] if len(parts) == 1 else memoryview(b"".join(parts))


def _lead_size(data: memoryview) -> int:
    """Bytes of the schema and channel records in front of the first message."""
    at = 0
    while at + _HEAD.size <= len(data):
        opcode, length = _HEAD.unpack_from(data, at)
        if opcode == records.MESSAGE:
            break
        at += _HEAD.size + length
    return min(at, len(data))


def _batch(data: memoryview, channel_id: int, chunk: Chunk | None) -> Batch:
    array = np.frombuffer(data, np.uint8)
    rows = _uniform(data, array, channel_id)
    if rows is not None:
        return Batch(array, rows, *_NO_PLACES)
    places = _indexed(array, chunk, channel_id) if chunk else None
    return Batch(array, None, *(places or walk_messages(data, channel_id)))


def _uniform(data: memoryview, array: NDArray[np.uint8], channel_id: int) -> Rows | None:
    """All of `data` behind its lead as messages of one length and this channel, or None."""
    start = _lead_size(data)
    size = len(data) - start
    if size < PAYLOAD:
        return None
    stride = _HEAD.unpack_from(data, start)[1] + _HEAD.size
    if stride < PAYLOAD or size % stride:
        return None
    rows = Rows(array, start, stride, size // stride, stride)
    head = _HEAD.pack(records.MESSAGE, stride - _HEAD.size) + channel_id.to_bytes(2, "little")
    first, last = int.from_bytes(head[:8], "little"), int.from_bytes(head[3:], "little")
    same = rows.column(-PAYLOAD, "<u8") == first
    if not same.all() or not (rows.column(3 - PAYLOAD, "<u8") == last).all():
        return None
    return rows


def _indexed(array: NDArray[np.uint8], chunk: Chunk, channel_id: int) -> Places | None:
    """The channel's messages by the message indexes, if these prove to be all of the chunk.

    They are if each place holds a message that ends where the next begins, and only other
    records lie in the gaps.
    """
    offsets = chunk.message_offsets()
    if offsets is None or not len(offsets) or offsets[-1] > len(array) - PAYLOAD or offsets[0] < 0:
        return None
    heads = taken(array, offsets, _START)
    lengths = heads["length"].astype(np.int64) + _HEAD.size  # below 0 where it is absurd
    is_message = (heads["opcode"] == records.MESSAGE).all() and lengths.min() >= PAYLOAD
    if not is_message or lengths.max() > len(array):
        return None
    ends = offsets + lengths
    gaps = [
        (int(ends[at]), int(offsets[at + 1])) for at in np.flatnonzero(ends[:-1] != offsets[1:])
    ]
    for start, end in [(0, int(offsets[0])), *gaps, (int(ends[-1]), len(array))]:
        if not _is_filler(chunk.data, start, end):
            return None
    mine = heads["channel"] == channel_id
    return (offsets, lengths) if mine.all() else (offsets[mine], lengths[mine])


def _is_filler(data: memoryview, at: int, end: int) -> bool:
    """True if whole records that are no messages fill the bytes from `at` to `end`."""
    while at + _HEAD.size <= end:
        opcode, length = _HEAD.unpack_from(data, at)
        if opcode == records.MESSAGE:
            return False
        at += _HEAD.size + length
    return at == end


def walk_messages(data: memoryview, channel_id: int) -> Places:
    """Offsets and whole lengths of the channel's messages, record by record."""
    at, end, unpack = 0, len(data), _HEAD.unpack_from
    low, high = channel_id & 0xFF, channel_id >> 8
    offsets, lengths = [], []
    while at + 11 <= end:
        opcode, length = unpack(data, at)
        length += 9
        mine = opcode == 5 and data[at + 9] == low and data[at + 10] == high
        if mine and length >= PAYLOAD and at + length <= end:
            offsets.append(at)
            lengths.append(length)
        at += length
    if at != end:
        raise Malformed("its records do not fill it")
    return np.array(offsets, np.int64), np.array(lengths, np.int64)


def _gather(array: NDArray[np.uint8], offsets: NDArray[np.int64], length: int) -> Rows:
    if len(offsets) == 1:
        return Rows(array, int(offsets[0]), length, 1, length)
    data = taken(array, offsets, np.dtype((np.void, length))).view(np.uint8)
    return Rows(data, 0, length, len(offsets), length)


def taken(array: NDArray[np.uint8], offsets: NDArray[np.int64], kind: DTypeLike) -> NDArray[Any]:
    """The values of `kind` that begin at `offsets`, however they are aligned; copies."""
    form = np.dtype(kind)
    places = len(array) - form.itemsize + 1
    if not len(offsets):
        return np.empty(0, form)
    values: NDArray[Any] = np.ndarray((places,), form, array, 0, (1,))[offsets]
    return values
