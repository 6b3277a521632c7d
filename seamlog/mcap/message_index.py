"""The message indexes behind a chunk: log times and offsets without unpacking it.

No CRC covers them, so they are good for finding, never for proving.
"""

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap import records
from seamlog.mcap.compression import NONE
from seamlog.mcap.records import ChunkEntry
from seamlog.mcap.rows import PAYLOAD
from seamlog.mcap.source import FileSource

_KEY = struct.Struct("<HI")
_PLACE = struct.Struct("<BQHIQ")


def read_message_index(
    source: FileSource, entry: ChunkEntry, channel_id: int
) -> NDArray[Any] | None:
    """(log time, offset in the unpacked chunk), shape (n, 2), by offset; None if unusable."""
    at = entry.index_offsets.get(channel_id, 0)
    head = records.RECORD_HEAD.size
    if not at or at + head + 6 > source.size:
        return None
    opcode, length = records.RECORD_HEAD.unpack_from(source.data, at)
    size = length - 6
    start = at + head + 6
    if opcode != records.MESSAGE_INDEX or size < 0 or size % 16 or start + size > source.size:
        return None
    if _KEY.unpack_from(source.data, at + head) != (channel_id, size):
        return None
    rows = np.frombuffer(source.data, "<u8", size // 8, start).reshape(-1, 2)
    offsets = rows[:, 1]
    return rows if (offsets[1:] > offsets[:-1]).all() else rows[np.argsort(offsets)]


def is_plausible(
    source: FileSource, entry: ChunkEntry, channel_id: int, rows: NDArray[Any]
) -> bool:
    """True if the rows fit the chunk; where it is not compressed, if they fit its messages."""
    times, offsets = rows[:, 0], rows[:, 1]
    last = entry.uncompressed_size - PAYLOAD
    if (times < entry.start_ns).any() or (times > entry.end_ns).any() or (offsets > last).any():
        return False
    if entry.compression != NONE:
        return True
    start = entry.offset + entry.length - entry.compressed_size
    for time, offset in rows.tolist():
        opcode, _, channel, _, log_time = _PLACE.unpack_from(source.data, start + offset)
        if (opcode, channel, log_time) != (records.MESSAGE, channel_id, time):
            return False
    return True
