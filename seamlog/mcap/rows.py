"""Where the messages of one channel lie in unpacked chunks, proved byte by byte, never assumed.

Nothing here trusts a message index: rows come from the chunk itself, which its CRC has proved.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap import records
from seamlog.mcap.records import Malformed

PAYLOAD = 31
"""Bytes of a Message record in front of its payload."""
_HEAD = records.RECORD_HEAD
_JOIN_BYTES = 1 << 20


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
        whole = self.column(-PAYLOAD, "u1", self.length)[chosen]
        return Rows(whole.reshape(-1), 0, self.length, len(whole), self.length)


@dataclass(frozen=True, slots=True)
class Batch:
    """Messages of one channel in file order, grouped by length.

    `groups` holds the rows of each length and their positions in the batch (None: all of it).
    """

    count: int
    groups: tuple[tuple[Rows, NDArray[np.int64] | None], ...]


def iter_batches(chunks: Iterable[memoryview], channel_id: int) -> Iterator[Batch]:
    """Batches of a channel's messages; small chunks are joined before they are looked at."""
    parts: list[memoryview] = []
    size, lead = 0, b""
    for chunk in chunks:
        if not lead or chunk[: len(lead)] != lead:
            lead = _lead(chunk)
        part = chunk[len(lead) :]
        if size + len(part) > _JOIN_BYTES and parts:
            yield _batch(_joined(parts), channel_id)
            parts, size = [], 0
        parts.append(part)
        size += len(part)
    if parts:
        yield _batch(_joined(parts), channel_id)


def _joined(parts: list[memoryview]) -> memoryview:
    return parts[0] if len(parts) == 1 else memoryview(b"".join(parts))


def _lead(chunk: memoryview) -> bytes:
    """The schema and channel records in front of the first message."""
    at = 0
    while at + _HEAD.size <= len(chunk):
        opcode, length = _HEAD.unpack_from(chunk, at)
        if opcode == records.MESSAGE:
            break
        at += _HEAD.size + length
    return bytes(chunk[:at])


def _batch(data: memoryview, channel_id: int) -> Batch:
    array = np.frombuffer(data, np.uint8)
    rows = _uniform(data, array, channel_id)
    if rows is not None:
        return Batch(rows.count, ((rows, None),))
    return _grouped(array, *walk_messages(data, channel_id))


def _uniform(data: memoryview, array: NDArray[np.uint8], channel_id: int) -> Rows | None:
    """All of `data` as messages of one length and this channel, or None."""
    if len(data) < PAYLOAD:
        return None
    stride = _HEAD.unpack_from(data)[1] + _HEAD.size
    if stride < PAYLOAD or len(data) % stride:
        return None
    rows = Rows(array, 0, stride, len(data) // stride, stride)
    same = (
        (rows.column(0 - PAYLOAD, "u1") == records.MESSAGE).all()
        and (rows.column(1 - PAYLOAD, "<u8") == stride - _HEAD.size).all()
        and (rows.column(9 - PAYLOAD, "<u2") == channel_id).all()
    )
    return rows if same else None


def walk_messages(data: memoryview, channel_id: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
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


def _grouped(
    array: NDArray[np.uint8], offsets: NDArray[np.int64], lengths: NDArray[np.int64]
) -> Batch:
    groups = []
    for length in np.unique(lengths).tolist():
        places = np.flatnonzero(lengths == length)
        rows = _gather(array, offsets[places], length)
        groups.append((rows, None if len(places) == len(offsets) else places))
    return Batch(len(offsets), tuple(groups))


def _gather(array: NDArray[np.uint8], offsets: NDArray[np.int64], length: int) -> Rows:
    if len(offsets) == 1:
        return Rows(array, int(offsets[0]), length, 1, length)
    windows = np.lib.stride_tricks.sliding_window_view(array, length)
    return Rows(windows[offsets].reshape(-1), 0, length, len(offsets), length)
