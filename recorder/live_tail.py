"""Follows a session while it is being recorded, by reading its growing files."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from zlib_ng.zlib_ng import crc32

from seamlog.errors import LimitExceeded
from seamlog.limits import LIMITS
from seamlog.mcap import parsing, records
from seamlog.mcap.compression import decompress
from seamlog.mcap.heads import message_heads
from seamlog.mcap.index import FileIndex, walk
from seamlog.mcap.records import ChannelRecord, Malformed, Schema
from seamlog.segments import segment_path

from .segment import part_of

_HEAD = records.RECORD_HEAD
_LEARNED = (records.SCHEMA, records.CHANNEL)


class LiveMessage(NamedTuple):
    """One message as it stands in the file."""

    channel: ChannelRecord
    schema: Schema | None
    log_time_ns: int
    payload: memoryview


class LiveTail:
    """Reads what has been added since the last look; never writes, never holds the writer up."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._number = 1
        self._descriptor = -1
        self._at = len(records.MAGIC)
        self._known = FileIndex()

    def messages(self) -> Iterator[LiveMessage]:
        """Messages of whole, proved chunks that are new."""
        while self._descriptor >= 0 or self._open():
            for opcode, content in self._new_records():
                if opcode == records.DATA_END:
                    self._next()
                    break
                if opcode == records.CHUNK:
                    yield from self._chunk(content)
            else:
                return

    def close(self) -> None:
        """Close the file."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1

    def _open(self) -> bool:
        path = segment_path(self._path, self._number)
        for candidate in (part_of(path), path):
            with suppress(OSError):
                self._descriptor = os.open(candidate, os.O_RDONLY | os.O_CLOEXEC)
                return True
        return False

    def _next(self) -> None:
        self.close()
        self._number += 1
        self._at, self._known = len(records.MAGIC), FileIndex()

    def _new_records(self) -> Iterator[tuple[int, memoryview]]:
        while True:
            head = os.pread(self._descriptor, _HEAD.size, self._at)
            if len(head) < _HEAD.size:
                return
            opcode, length = _HEAD.unpack(head)
            end = self._at + _HEAD.size + length
            if end > os.fstat(self._descriptor).st_size or length > LIMITS.chunk_bytes:
                return
            content = b""
            if opcode == records.CHUNK:
                content = os.pread(self._descriptor, length, self._at + _HEAD.size)
                if len(content) < length:
                    return
            self._at = end
            yield opcode, memoryview(content)

    def _chunk(self, content: memoryview) -> Iterator[LiveMessage]:
        try:
            head = parsing.parse_chunk_head(content)
            body = content[head.data_offset :]
            size = head.uncompressed_size
            data = memoryview(decompress(body, head.compression, size, LIMITS.chunk_bytes))
            if head.crc and crc32(data) != head.crc:
                return
            for opcode, offset, length in walk(data, 0, len(data)):
                if opcode not in _LEARNED:
                    break
                self._known.learn(opcode, data[offset + _HEAD.size : offset + length])
            offsets, heads = message_heads(data)
        except (Malformed, LimitExceeded):
            return
        for offset, row in zip(offsets.tolist(), heads, strict=True):
            channel = self._known.channels.get(int(row["channel"]))
            if channel is not None:
                schema = self._known.schemas.get(channel.schema_id)
                end = offset + _HEAD.size + int(row["length"])
                payload = data[offset + heads.dtype.itemsize : end]
                yield LiveMessage(channel, schema, int(row["log_time"]), payload)
