"""The message indexes behind a chunk: log times and offsets without unpacking it.

No CRC covers them, so they are good for finding, never for proving.
"""

import struct

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap import records
from seamlog.mcap.compression import NONE
from seamlog.mcap.records import ChunkEntry
from seamlog.mcap.rows import PAYLOAD
from seamlog.mcap.source import FileSource

_KEY = struct.Struct("<HI")
_ROW = struct.Struct("<QQ")
_PLACE = struct.Struct("<BQHIQ")


def read_message_index(source: FileSource, entry: ChunkEntry, channel_id: int) -> memoryview | None:
    """Rows of uint64 log time and uint64 offset in the unpacked chunk; None if unusable."""
    at = entry.index_offsets.get(channel_id, 0)
    start = at + records.RECORD_HEAD.size + _KEY.size
    source.used()
    if not at or start > source.size:
        return None
    opcode, length = records.RECORD_HEAD.unpack_from(source.data, at)
    number, size = _KEY.unpack_from(source.data, at + records.RECORD_HEAD.size)
    if (opcode, number, length) != (records.MESSAGE_INDEX, channel_id, size + _KEY.size):
        return None
    if size % _ROW.size or start + size > source.size:
        return None
    return source.data[start : start + size]


def index_count(source: FileSource, entry: ChunkEntry, channel_id: int) -> int | None:
    """Messages of the channel in the chunk by its message index; None if unusable."""
    rows = read_message_index(source, entry, channel_id)
    return None if rows is None else len(rows) // _ROW.size


def all_offsets(source: FileSource, entry: ChunkEntry) -> NDArray[np.int64] | None:
    """Offsets of all messages in the unpacked chunk, in order; None if an index is unusable."""
    found = [read_message_index(source, entry, number) for number in entry.index_offsets]
    if not found or any(rows is None for rows in found):
        return None
    offsets = [np.frombuffer(rows, "<u8")[1::2] for rows in found if rows is not None]
    joined = np.concatenate(offsets).astype(np.int64)
    is_sorted = (joined[1:] > joined[:-1]).all()
    return joined if is_sorted else np.sort(joined)


def plausible_places(
    source: FileSource, entry: ChunkEntry, channel_id: int
) -> list[tuple[int, int]] | None:
    """Log time and offset of each message, by offset; None if they do not fit the chunk.

    Where the chunk is not compressed they must fit its messages, too.
    """
    rows = read_message_index(source, entry, channel_id)
    if rows is None:
        return None
    places = sorted(_ROW.iter_unpack(rows), key=lambda row: row[1])
    last = entry.uncompressed_size - PAYLOAD
    if any(offset > last or not entry.start_ns <= t <= entry.end_ns for t, offset in places):
        return None
    if entry.compression == NONE and not _fits(source, entry, channel_id, places):
        return None
    return places


def _fits(
    source: FileSource, entry: ChunkEntry, channel_id: int, places: list[tuple[int, int]]
) -> bool:
    start = entry.offset + entry.length - entry.compressed_size
    for time, offset in places:
        opcode, _, number, _, log_time = _PLACE.unpack_from(source.data, start + offset)
        if (opcode, number, log_time) != (records.MESSAGE, channel_id, time):
            return False
    return True
