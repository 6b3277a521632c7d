"""The open tail of a cut file: messages of a chunk whose end, and with it its proof, is missing."""

import re
import struct
from typing import Any

import lz4.frame
import numpy as np
import zstandard
from numpy.typing import NDArray

from seamlog.limits import Limits
from seamlog.mcap import records
from seamlog.mcap.compression import LZ4, NONE, ZSTD
from seamlog.mcap.heads import HEAD
from seamlog.mcap.source import FileSource

_HEAD = struct.Struct("<BQQQQII")
_ZEROS = re.compile(rb"\0+\Z")
_PAGE = 4096


def tail_messages(
    source: FileSource, start: int, limits: Limits
) -> tuple[memoryview, NDArray[np.int64], NDArray[Any]] | None:
    """Whole messages of a chunk at `start` that the end of the file cuts; None if there are none.

    They must agree with the chunk's head. Pages of zeros at the end count as not written.
    """
    content = _begun(source, start, limits)
    if content is None:
        return None
    data = memoryview(content)
    _, _, first_ns, last_ns, _, _, _ = _HEAD.unpack_from(source.data, start)
    offsets, at = [], 0
    while at + records.RECORD_HEAD.size <= len(data):
        opcode, length = records.RECORD_HEAD.unpack_from(data, at)
        end = at + records.RECORD_HEAD.size + length
        if not 0 < opcode <= records.MESSAGE or end > len(data):
            break
        if opcode == records.MESSAGE:
            time = int.from_bytes(data[at + 15 : at + 23], "little")
            if length < HEAD.itemsize - records.RECORD_HEAD.size or not first_ns <= time <= last_ns:
                break
            offsets.append(at)
        at = end
    if not offsets:
        return None
    places = np.array(offsets, np.int64)
    windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(data, np.uint8), HEAD.itemsize)
    return data, places, windows[places].reshape(-1).view(HEAD)


def _begun(source: FileSource, start: int, limits: Limits) -> bytes | None:
    """What can be unpacked of a chunk whose record goes on behind the end of the file."""
    if start + _HEAD.size > source.size:
        return None
    opcode, length, _, _, size, _, name_size = _HEAD.unpack_from(source.data, start)
    is_cut = start + records.RECORD_HEAD.size + length > source.size
    if opcode != records.CHUNK or not is_cut or name_size > 4 or size > limits.chunk_bytes:
        return None
    at = start + _HEAD.size + name_size
    name = bytes(source.data[at - name_size : at])
    body = bytes(source.data[at + 8 : _written_end(source, at + 8)])
    try:
        return _unpacked(body, name.decode("latin-1"), size)
    except (zstandard.ZstdError, RuntimeError):
        return None


def _written_end(source: FileSource, start: int) -> int:
    """Where the file ends, pages of zeros at its end not counted."""
    zeros = _ZEROS.search(source.data, start)
    if zeros is None or zeros.end() - zeros.start() < _PAGE:
        return source.size
    return max(start, zeros.start() // _PAGE * _PAGE)


def _unpacked(body: bytes, compression: str, size: int) -> bytes | None:
    if compression == NONE:
        return body
    if compression == ZSTD:
        found = zstandard.ZstdDecompressor().stream_reader(body).read(size)
    elif compression == LZ4:
        with lz4.frame.LZ4FrameDecompressor() as decompressor:
            found = decompressor.decompress(body, max_length=size + 1)
    else:
        return None
    return found if len(found) <= size else None
