"""Reads the table of contents of a file whose summary is missing or damaged.

The walk goes from record to record over their heads; a chunk is unpacked only where it must teach
a channel or has no message index behind it.
"""

import struct
from collections.abc import Mapping

from seamlog.limits import Limits
from seamlog.mcap import parsing, records
from seamlog.mcap.chunks import BARE, read_chunk
from seamlog.mcap.index import FileIndex, read_header, walk
from seamlog.mcap.records import ChunkEntry, Malformed
from seamlog.mcap.source import FileSource

_HEAD = records.RECORD_HEAD.size
_INDEX = struct.Struct("<HI")


def scan(source: FileSource, problem: str, limits: Limits) -> FileIndex:
    """Walk over `source`; `problem` says why its summary was not used, "" if it just has none."""
    profile, library = read_header(source)
    scanner = _Scanner(source, limits, FileIndex(profile, library))
    scanner.run()
    if problem:
        counted = scanner.index.statistics
        scanner.index.problems.insert(
            0,
            f"{problem}: {counted.message_count} messages in {counted.chunk_count} whole chunks "
            f"were found{scanner.rest}",
        )
    elif scanner.rest:
        scanner.index.problems.insert(0, f"{source.path}{scanner.rest}")
    return scanner.index


class _Scanner:
    """State of one walk."""

    def __init__(self, source: FileSource, limits: Limits, index: FileIndex) -> None:
        self.source, self.limits, self.index = source, limits, index
        self.rest = ""
        self._open: ChunkEntry | None = None
        self._counts: dict[int, int] = {}
        self._bare: list[int] = []

    def run(self) -> None:
        source, at = self.source, len(records.MAGIC)
        try:
            for opcode, offset, length in walk(source.data, at, source.size):
                if opcode in (records.DATA_END, records.FOOTER):
                    break
                self._try(opcode, offset, length)
                at = offset + length
        except Malformed:
            left = source.size - at
            self.rest = f"; {left} bytes from byte {at} on are no whole record and were not read"
        self._close_chunk()
        self._close_bare(at)

    def _try(self, opcode: int, offset: int, length: int) -> None:
        try:
            self._take(opcode, offset, length)
        except Malformed as error:
            self._leave_out(f"the record at byte {offset} ({length} bytes)", error)

    def _leave_out(self, what: str, error: Malformed) -> None:
        self.index.problems.append(
            f"{self.source.path}: {what} is damaged and was left out: {error}"
        )

    def _take(self, opcode: int, offset: int, length: int) -> None:
        content = self.source.data[offset + _HEAD : offset + length]
        if opcode == records.MESSAGE_INDEX:
            self._take_message_index(offset, length, content)
            return
        self._close_chunk()
        if opcode == records.MESSAGE:
            self._take_message(offset, content)
            return
        if opcode in (records.SCHEMA, records.CHANNEL):
            self.index.learn(opcode, content)
            return
        self._close_bare(offset)
        if opcode == records.CHUNK:
            self._open = _entry(offset, length, content)
        elif opcode == records.ATTACHMENT:
            self.index.attachments.append(_attachment(offset, length, content))
        elif opcode == records.METADATA:
            name, _ = parsing.parse_metadata(content)
            self.index.metadata.append(records.MetadataEntry(offset, length, name))

    def _take_message_index(self, offset: int, length: int, content: memoryview) -> None:
        if self._open is None or len(content) < _INDEX.size:
            return
        channel_id, size = _INDEX.unpack_from(content)
        offsets = {**self._open.index_offsets, channel_id: offset}
        self._open = self._open._replace(
            index_offsets=offsets, index_length=self._open.index_length + length
        )
        self._counts[channel_id] = size // 16

    def _take_message(self, offset: int, content: memoryview) -> None:
        if len(content) < 22:
            raise Malformed("a message has no head")
        if not self._bare:
            self._bare = [offset, 1 << 64, 0]
        log_time = int.from_bytes(content[6:14], "little")
        self._bare[1:] = min(self._bare[1], log_time), max(self._bare[2], log_time)
        channel_id = int.from_bytes(content[:2], "little")
        self._counts[channel_id] = self._counts.get(channel_id, 0) + 1

    def _close_bare(self, end: int) -> None:
        if not self._bare:
            return
        start, first, last = self._bare
        offsets = dict.fromkeys(self._counts, 0)
        size = end - start
        entry = ChunkEntry(first, last, start, size, offsets, 0, BARE, size, size)
        self._bare = []
        self._note(entry, self._counts)

    def _close_chunk(self) -> None:
        entry, self._open = self._open, None
        if entry is None:
            return
        known = self.index.channels
        if not entry.index_offsets or any(n not in known for n in entry.index_offsets):
            try:
                entry = self._learn(entry)
            except Malformed as error:
                self._counts = {}
                self._leave_out(f"the chunk at byte {entry.offset} ({entry.length} bytes)", error)
                return
        self._note(entry, self._counts)

    def _learn(self, entry: ChunkEntry) -> ChunkEntry:
        """Read a chunk's channels, and its counts where no message index follows it."""
        data = read_chunk(self.source, entry, self.limits)
        counts: dict[int, int] = {}
        for opcode, offset, length in walk(data, 0, len(data)):
            if opcode == records.MESSAGE:
                channel_id = int.from_bytes(data[offset + _HEAD : offset + _HEAD + 2], "little")
                counts[channel_id] = counts.get(channel_id, 0) + 1
            else:
                self.index.learn(opcode, data[offset + _HEAD : offset + length])
        self._counts = counts
        return entry._replace(index_offsets={n: entry.index_offsets.get(n, 0) for n in counts})

    def _note(self, entry: ChunkEntry, counts: Mapping[int, int]) -> None:
        self.index.chunks.append(entry)
        self.index.statistics.chunk_count += 1
        for channel_id, count in counts.items():
            self.index.statistics.add(channel_id, count, entry.start_ns, entry.end_ns)
        self._counts = {}


def _entry(offset: int, length: int, content: memoryview) -> ChunkEntry:
    head = parsing.parse_chunk_head(content)
    if head.data_offset + head.data_size != len(content):
        raise Malformed("a chunk's data does not fill its record")
    return ChunkEntry(
        head.start_ns,
        head.end_ns,
        offset,
        length,
        {},
        0,
        head.compression,
        head.data_size,
        head.uncompressed_size,
    )


def _attachment(offset: int, length: int, content: memoryview) -> records.AttachmentEntry:
    cursor = parsing.Cursor(content)
    log_time, create_time = cursor.u64(), cursor.u64()
    name, media_type = cursor.string(), cursor.string()
    return records.AttachmentEntry(
        offset, length, log_time, create_time, cursor.u64(), name, media_type
    )
