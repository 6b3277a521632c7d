"""Reads one chunk: head against index, bytes counted while decompressing, CRC."""

import struct

from zlib_ng.zlib_ng import crc32

from seamlog.errors import LimitExceeded
from seamlog.limits import Limits
from seamlog.mcap import records
from seamlog.mcap.compression import decompress
from seamlog.mcap.records import ChunkEntry, Malformed
from seamlog.mcap.source import FileSource

BARE = "bare"
"""Compression of a run of messages that stand outside chunks, in files of others."""

_HEAD = struct.Struct("<BQQQQII")


def read_chunk(source: FileSource, entry: ChunkEntry, limits: Limits) -> memoryview:
    """The records of a chunk, proved by its CRC (files of others may have none).

    Raises `Malformed` if the chunk is damaged, `LimitExceeded` if it is too large.
    """
    if entry.compression == BARE:
        return source.data[entry.offset : entry.offset + entry.length]
    return memoryview(_unpacked(source, entry, limits))


def check_expansion(source: FileSource, unpacked_bytes: int, limits: Limits) -> None:
    """Raise `LimitExceeded` if the chunks of a file come to more than any log does."""
    if unpacked_bytes > max(limits.chunk_bytes, limits.expansion * source.size):
        raise LimitExceeded(
            f"{source.path}: its chunks unpack to {unpacked_bytes} bytes or more, over "
            f"{limits.expansion} times the file (limit expansion): this is no log but a bomb; do "
            "not trust where it comes from"
        )


def _unpacked(source: FileSource, entry: ChunkEntry, limits: Limits) -> memoryview:
    data, at, name = source.data, entry.offset, entry.compression.encode()
    start = at + _HEAD.size + len(name) + 8
    if start > source.size:
        raise Malformed("it is cut")
    opcode, length, _, _, size, crc, name_size = _HEAD.unpack_from(data, at)
    end = start + entry.compressed_size
    expected = (records.CHUNK, end - at - records.RECORD_HEAD.size, entry.uncompressed_size)
    if (opcode, length, size) != expected or name_size != len(name) or end > source.size:
        raise Malformed("its head is not what the index says")
    if data[at + _HEAD.size : start - 8] != name:
        raise Malformed("its compression is not what the index says")
    try:
        unpacked = decompress(data[start:end], entry.compression, size, limits.chunk_bytes)
    except LimitExceeded as error:
        raise LimitExceeded(
            f"{source.path}: the chunk at byte {at}: {error}; do not trust where it comes from"
        ) from error
    if crc and crc32(unpacked) != crc:
        raise Malformed("its CRC is wrong")
    source.used(entry.length)
    return memoryview(unpacked)
