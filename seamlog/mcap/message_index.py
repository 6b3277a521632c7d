"""The message indexes behind a chunk: log times and offsets without unpacking it.

No CRC covers them, so they are good for finding, never for proving.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap import records
from seamlog.mcap.records import ChunkEntry
from seamlog.mcap.source import FileSource


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
    if int.from_bytes(source.data[at + head : at + head + 2], "little") != channel_id:
        return None
    rows = np.frombuffer(source.data, "<u8", size // 8, start).reshape(-1, 2)
    offsets = rows[:, 1]
    return rows if (offsets[1:] > offsets[:-1]).all() else rows[np.argsort(offsets)]
