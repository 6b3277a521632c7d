"""Finds in a damaged file what is provably whole: records that carry a CRC of their own.

Nothing is believed for its looks. A chunk or an attachment counts only when its CRC fits, a
summary only when the footer's CRC fits; whole MCAP files inside attachments are stepped over.
"""

import re
import struct
from collections.abc import Iterator

import numpy as np
from zlib_ng.zlib_ng import crc32

from seamlog.errors import LimitExceeded
from seamlog.limits import Limits
from seamlog.mcap import parsing, records
from seamlog.mcap.compression import COMPRESSIONS, NONE, decompress
from seamlog.mcap.records import Malformed
from seamlog.mcap.source import FileSource

_HEAD = records.RECORD_HEAD.size
_FIRST_BLOCK, _LAST_BLOCK = 1 << 14, 1 << 20
_MAGIC = re.compile(re.escape(records.MAGIC))
_DATA_END = re.compile(re.escape(records.RECORD_HEAD.pack(records.DATA_END, 4)))
_SPARE_BYTES = 256 << 20
"""Bytes that proofs may look at in vain, above twice the size of the file."""


class Salvage:
    """Looks for proved records; the work spent on what fails to prove is bounded."""

    def __init__(self, source: FileSource, limits: Limits) -> None:
        self.source, self.limits = source, limits
        self._left = 2 * source.size + _SPARE_BYTES

    def next_proved(self, start: int) -> int | None:
        """Offset of the next chunk or attachment from `start` on whose CRC fits."""
        data = self.source.data
        inside_from = start
        for at in self._candidates(start):
            if at < inside_from or not self.is_proved(at):
                if self._left < 0:
                    break
                continue
            nested = _MAGIC.search(data, max(inside_from, len(records.MAGIC)), at)
            if nested is None:
                return at
            behind = _MAGIC.search(data, nested.end())
            if behind is None:
                break
            inside_from = behind.end()
        return None

    def is_proved(self, at: int) -> bool:
        """True if a whole record stands at `at` that its own CRC proves."""
        data, size = self.source.data, self.source.size
        if at + _HEAD > size:
            return False
        opcode, length = records.RECORD_HEAD.unpack_from(data, at)
        if length > size - at - _HEAD:
            return False
        content = data[at + _HEAD : at + _HEAD + length]
        try:
            if opcode == records.CHUNK:
                return self._proves_chunk(content)
            return opcode == records.ATTACHMENT and self._proves_attachment(content)
        except (Malformed, LimitExceeded):
            return False

    def _proves_chunk(self, content: memoryview) -> bool:
        head = parsing.parse_chunk_head(content)
        if not head.crc or head.compression not in COMPRESSIONS:
            return False
        if head.data_offset + head.data_size != len(content):
            return False
        if head.compression == NONE and head.data_size != head.uncompressed_size:
            return False
        body = content[head.data_offset :]
        limit = self.limits.chunk_bytes
        self._left -= min(head.uncompressed_size, limit)
        data = decompress(body, head.compression, head.uncompressed_size, limit)
        proved = crc32(data) == head.crc
        self._left += min(head.uncompressed_size, limit) if proved else 0
        return proved

    def _proves_attachment(self, content: memoryview) -> bool:
        end = attachment_end(content)
        (stored,) = struct.unpack_from("<I", content, end)
        self._left -= end
        return bool(stored) and crc32(content[:end]) == stored

    def _candidates(self, start: int) -> Iterator[int]:
        """Places where a chunk or attachment of less than 2**40 bytes may begin."""
        block, size = start, _FIRST_BLOCK
        while block < self.source.size:
            piece = np.frombuffer(self.source.data[block : block + size + _HEAD], np.uint8)
            places = np.flatnonzero((piece == records.CHUNK) | (piece == records.ATTACHMENT))
            places = places[places < min(size, len(piece) - _HEAD)]
            for high in (6, 7, 8):
                places = places[piece[places + high] == 0]
            yield from (places + block).tolist()
            block += size
            size = min(2 * size, _LAST_BLOCK)


def attachment_end(content: memoryview) -> int:
    """Bytes of an attachment's content in front of its CRC; `Malformed` if it does not fit."""
    cursor = parsing.Cursor(content, 16)
    cursor.string()
    cursor.string()
    cursor.take(cursor.u64())
    if cursor.left != 4:
        raise Malformed("an attachment does not fill its record")
    return cursor.at


def proved_summary(source: FileSource) -> int | None:
    """Start of a summary that the CRC in the footer proves, wherever it is by now."""
    data, end = source.data, source.size - len(records.MAGIC)
    if source.size < 2 * len(records.MAGIC) + records.FOOTER_BYTES or data[end:] != records.MAGIC:
        return None
    (stored,) = struct.unpack_from("<I", data, end - 4)
    if not stored:
        return None
    places = [match.start() for match in _DATA_END.finditer(data)]
    for place in reversed(places[-8:]):
        start = place + _HEAD + 4
        if crc32(data[start : end - 4]) == stored:
            return start
    return None
