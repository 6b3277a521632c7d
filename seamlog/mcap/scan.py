"""Reads the table of contents of a file whose summary is missing or damaged.

The walk goes from record to record over their heads; a chunk is unpacked only where it must teach
a channel, has no message index behind it or one that speaks of other times. Behind damage the
walk goes on at the next record that its own CRC proves.
"""

import struct
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import LimitExceeded, SessionError
from seamlog.limits import Limits
from seamlog.mcap import parsing, records
from seamlog.mcap.chunks import BARE, check_expansion, read_chunk
from seamlog.mcap.compression import COMPRESSIONS, can_hold
from seamlog.mcap.heads import message_heads
from seamlog.mcap.index import FileIndex, read_header, walk
from seamlog.mcap.records import ChunkEntry, Malformed
from seamlog.mcap.salvage import Salvage, attachment_end, proved_summary
from seamlog.mcap.source import FileSource

_HEAD = records.RECORD_HEAD.size
_INDEX = struct.Struct("<HI")
_ENDS = {records.DATA_END: 4, records.FOOTER: 20}
_PRIVATE = 128
"""Opcodes from here on belong to applications and are passed over."""
_NAMED_GAPS = 5


def scan(source: FileSource, problem: str, limits: Limits) -> FileIndex:
    """Walk over `source`; `problem` says why its summary was not used, "" if it just has none.

    Raises `SessionError` if nothing whole is in it.
    """
    scanner = _Scanner(source, limits)
    scanner.run()
    index = scanner.index
    expected = _learn_from_summary(source, index) if problem else 0
    rest = _gaps_text(index.gaps)
    if problem:
        counted = index.statistics
        share = f" of the {expected} that it held" if expected else ""
        index.problems.insert(
            0,
            f"{problem}: {counted.message_count} messages{share} in {counted.chunk_count} whole "
            f"chunks were found{rest}",
        )
    elif rest:
        index.problems.insert(0, f"{source.path}{rest}")
    _note_unknown(source, index)
    return index


def _gaps_text(gaps: list[tuple[int, int]]) -> str:
    if not gaps:
        return ""
    named = [f"{end - start} bytes from byte {start} on" for start, end in gaps[:_NAMED_GAPS]]
    if len(gaps) > _NAMED_GAPS:
        rest = sum(end - start for start, end in gaps[_NAMED_GAPS:])
        named.append(f"{rest} bytes in {len(gaps) - _NAMED_GAPS} more places")
    return f"; {', '.join(named)} are no whole record and were not read"


def _learn_from_summary(source: FileSource, index: FileIndex) -> int:
    """Take in the channels of a summary that is whole, if not where it should be.

    Returns the number of messages that it counts, 0 without one.
    """
    start = proved_summary(source)
    if start is None:
        return 0
    told = FileIndex()
    with suppress(Malformed):
        for opcode, offset, length in walk(source.data, start, source.size - records.END_BYTES):
            told.learn(opcode, source.data[offset + _HEAD : offset + length])
    index.schemas = told.schemas | index.schemas
    index.channels = told.channels | index.channels
    index.expected = told.statistics.channel_counts
    return told.statistics.message_count


def _note_unknown(source: FileSource, index: FileIndex) -> None:
    used = {number for entry in index.chunks for number in entry.index_offsets}
    for number in sorted(used - index.channels.keys()):
        count = index.statistics.channel_counts.get(number, 0)
        index.problems.append(
            f"{source.path}: {count} messages are of channel {number}; what that was is lost"
        )


class _Scanner:
    """State of one walk."""

    def __init__(self, source: FileSource, limits: Limits) -> None:
        self.source, self.limits = source, limits
        self.index = FileIndex()
        self._salvage = Salvage(source, limits)
        self._open: ChunkEntry | None = None
        self._span: list[int] = []
        self._counts: dict[int, int] = {}
        self._bare: list[int] = []
        self._unpacked = 0
        self._beyond: LimitExceeded | None = None

    def run(self) -> None:
        at: int | None = len(records.MAGIC)
        lost: SessionError | None = None
        try:
            self.index.profile, self.index.library = read_header(self.source)
        except SessionError as error:
            lost, at = error, self._resume(0, self._salvage.next_proved(0))
        while at is not None:
            at = self._walk(at)
        if self._beyond is not None and not self.index.chunks:
            raise self._beyond
        if lost is not None:
            if not self.index.chunks and not self.index.attachments:
                raise lost
            self.index.problems.append(f"{self.source.path}: its first bytes are damaged")

    def _walk(self, start: int) -> int | None:
        """Take in records from `start` on; where to go on behind damage, None at the end."""
        source, at = self.source, start
        try:
            for opcode, offset, length in walk(source.data, at, source.size):
                if _ENDS.get(opcode) == length - _HEAD:
                    self.index.reaches_end = True
                    self._close_chunk()
                    self._close_bare(offset)
                    return None
                at = offset
                self._take(opcode, offset, length)
                at = offset + length
        except Malformed as error:
            self._close_chunk()
            is_cut = at + _HEAD > source.size or _is_head(source.data, at, 1 << 62)
            self._close_bare(at if is_cut else self._last_bare(at))
            return self._go_on(at, error)
        self._close_chunk()
        self._close_bare(source.size)
        return None

    def _go_on(self, at: int, error: Malformed) -> int | None:
        """Behind a record whose frame holds, else at the next proved one.

        A frame holds if records follow it one behind the other, up to the next proved one.
        """
        data, size = self.source.data, self.source.size
        found = self._salvage.next_proved(at + 1)
        if _is_head(data, at, size):
            length = _HEAD + int(records.RECORD_HEAD.unpack_from(data, at)[1])
            end = at + length
            is_framed = end == size or _is_head(data, end, size)
            if is_framed and (found is None or _leads_to(data, end, found)):
                self._leave_out("record", at, length, error)
                return end
        return self._resume(at, found)

    def _resume(self, gap: int, found: int | None) -> int | None:
        end = self.source.size if found is None else found
        if end > gap:
            self.index.gaps.append((gap, end))
        return found

    def _leave_out(self, what: str, offset: int, length: int, error: Exception) -> None:
        self.index.left_out.append((offset, length, str(error)))
        self.index.problems.append(
            f"{self.source.path}: the {what} at byte {offset} ({length} bytes) is damaged and was "
            f"left out: {error}"
        )

    def _take(self, opcode: int, offset: int, length: int) -> None:
        content = self.source.data[offset + _HEAD : offset + length]
        self.source.used()
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
            self._unpacked += min(self._open.uncompressed_size, self.limits.chunk_bytes)
            check_expansion(self.source, self._unpacked, self.limits)
        elif opcode == records.ATTACHMENT:
            self.index.attachments.append(_attachment(offset, length, content))
        elif opcode == records.METADATA:
            name, _ = parsing.parse_metadata(content)
            self.index.metadata.append(records.MetadataEntry(offset, length, name))
        elif opcode < _PRIVATE and (opcode, offset) != (records.HEADER, len(records.MAGIC)):
            raise Malformed(f"no record of kind {opcode} belongs here")

    def _take_message_index(self, offset: int, length: int, content: memoryview) -> None:
        if len(content) < _INDEX.size:
            raise Malformed("a message index has no head")
        channel_id, size = _INDEX.unpack_from(content)
        if size != len(content) - _INDEX.size or size % 16:
            raise Malformed("a message index does not fill its record")
        if self._open is None:
            return
        offsets = {**self._open.index_offsets, channel_id: offset}
        self._open = self._open._replace(
            index_offsets=offsets, index_length=self._open.index_length + length
        )
        self._counts[channel_id] = size // 16
        if size:
            times = np.frombuffer(content, "<u8", offset=_INDEX.size)[::2]
            self._span += (int(times.min()), int(times.max()))

    def _take_message(self, offset: int, content: memoryview) -> None:
        if len(content) < 22:
            raise Malformed("a message has no head")
        if not self._bare:
            self._bare = [offset, offset, 1 << 64, 0]
        log_time = int.from_bytes(content[6:14], "little")
        self._bare[1:] = offset, min(self._bare[2], log_time), max(self._bare[3], log_time)
        channel_id = int.from_bytes(content[:2], "little")
        self._counts[channel_id] = self._counts.get(channel_id, 0) + 1

    def _last_bare(self, at: int) -> int:
        """Where the last message outside chunks begins: its length led to what is no record."""
        if not self._bare:
            return at
        content = self.source.data[self._bare[1] + _HEAD :]
        self._counts[int.from_bytes(content[:2], "little")] -= 1
        return self._bare[1]

    def _close_bare(self, end: int) -> None:
        if not self._bare:
            return
        start, _, first, last = self._bare
        counts = {number: count for number, count in self._counts.items() if count}
        size = end - start
        self._bare, self._counts = [], {}
        if counts:
            offsets = dict.fromkeys(counts, 0)
            entry = ChunkEntry(first, last, start, size, offsets, 0, BARE, size, size)
            self._note(entry, counts)

    def _close_chunk(self) -> None:
        entry, self._open = self._open, None
        span, self._span = self._span, []
        if entry is None:
            return
        known = self.index.channels
        told = (min(span), max(span)) if span else ()
        if told != (entry.start_ns, entry.end_ns) or any(
            number not in known for number in entry.index_offsets
        ):
            try:
                entry = self._learn(entry)
            except (Malformed, LimitExceeded) as error:
                self._counts = {}
                self._leave_out("chunk", entry.offset, entry.length, error)
                if isinstance(error, LimitExceeded):
                    self._beyond = error
                return
        self._note(entry, self._counts)

    def _learn(self, entry: ChunkEntry) -> ChunkEntry:
        """Read a chunk's channels, counts and times, where nothing else tells them for sure."""
        data = read_chunk(self.source, entry, self.limits)
        offsets, heads = message_heads(data)
        self._learn_records(data, offsets, heads)
        numbers, counts = np.unique(heads["channel"], return_counts=True)
        self._counts = dict(zip(numbers.tolist(), counts.tolist(), strict=True))
        if self._counts:
            times = heads["log_time"]
            entry = entry._replace(start_ns=int(times.min()), end_ns=int(times.max()))
        places = {number: entry.index_offsets.get(number, 0) for number in self._counts}
        return entry._replace(index_offsets=places)

    def _learn_records(
        self, data: memoryview, offsets: NDArray[np.int64], heads: NDArray[Any]
    ) -> None:
        """Take in what stands between the messages."""
        ends = np.append(0, offsets + heads["length"].astype(np.int64) + _HEAD)
        starts = np.append(offsets, len(data))
        for gap in np.flatnonzero(ends != starts).tolist():
            for opcode, offset, length in walk(data, int(ends[gap]), int(starts[gap])):
                self.index.learn(opcode, data[offset + _HEAD : offset + length])

    def _note(self, entry: ChunkEntry, counts: Mapping[int, int]) -> None:
        self.index.chunks.append(entry)
        self.index.statistics.chunk_count += 1
        for channel_id, count in counts.items():
            self.index.statistics.add(channel_id, count, entry.start_ns, entry.end_ns)
        self._counts = {}


def _leads_to(data: memoryview, at: int, target: int) -> bool:
    """True if whole records stand one behind the other from `at` up to `target`."""
    while at < target and _is_head(data, at, target):
        at += _HEAD + int(records.RECORD_HEAD.unpack_from(data, at)[1])
    return at == target


def _is_head(data: memoryview, at: int, end: int) -> bool:
    """True if the head of a record of MCAP that ends before `end` stands at `at`."""
    if at + _HEAD > len(data):
        return False
    opcode, length = records.RECORD_HEAD.unpack_from(data, at)
    return bool(0 < opcode <= records.DATA_END and length <= end - at - _HEAD)


def _entry(offset: int, length: int, content: memoryview) -> ChunkEntry:
    head = parsing.parse_chunk_head(content)
    if head.data_offset + head.data_size != len(content):
        raise Malformed("a chunk's data does not fill its record")
    if head.compression in COMPRESSIONS and not can_hold(
        content[head.data_offset :], head.compression, head.uncompressed_size
    ):
        raise Malformed(f"its data is not what unpacks to {head.uncompressed_size} bytes")
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
    attachment_end(content)
    cursor = parsing.Cursor(content)
    log_time, create_time = cursor.u64(), cursor.u64()
    name, media_type = cursor.string(), cursor.string()
    return records.AttachmentEntry(
        offset, length, log_time, create_time, cursor.u64(), name, media_type
    )
