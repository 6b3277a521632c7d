"""Reads one chunk: head against index, bytes counted while decompressing, CRC."""

import struct

from zlib_ng.zlib_ng import crc32

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
    unpacked = decompress(data[start:end], entry.compression, size, limits.chunk_bytes)
    if crc and crc32(unpacked) != crc:
        raise Malformed("its CRC is wrong")
    source.used(entry.length)
    return memoryview(unpacked)
