"""What is in an MCAP file and where, from its summary, else from a walk over the records."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from zlib_ng.zlib_ng import crc32

from seamlog.errors import LimitExceeded, SessionError
from seamlog.limits import LIMITS, Limits
from seamlog.mcap import parsing, records
from seamlog.mcap.chunks import check_expansion
from seamlog.mcap.records import (
    AttachmentEntry,
    ChannelRecord,
    ChunkEntry,
    Malformed,
    MetadataEntry,
    Schema,
    Statistics,
)
from seamlog.mcap.source import FileSource

_LEAST_CHUNK_BYTES = 49
"""Head, times, sizes and CRC of an empty chunk."""


@dataclass(slots=True)
class FileIndex:
    """Table of contents of one file; `problems` says in words what is missing or damaged."""

    profile: str = ""
    library: str = ""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    chunks: list[ChunkEntry] = field(default_factory=list)
    attachments: list[AttachmentEntry] = field(default_factory=list)
    metadata: list[MetadataEntry] = field(default_factory=list)
    statistics: Statistics = field(default_factory=Statistics)
    problems: list[str] = field(default_factory=list)
    gaps: list[tuple[int, int]] = field(default_factory=list)
    """Bytes from and to that hold nothing whole, where the file had to be walked over."""
    left_out: list[tuple[int, int, str]] = field(default_factory=list)
    """Offset, length and fault of damaged records that a walk left out."""
    reaches_end: bool = False
    """A walk came to the record that ends the data: nothing was cut off."""
    expected: dict[int, int] = field(default_factory=dict)
    """Channel id to the number of messages that a proved summary counts."""
    summary_start: int | None = None
    """Where the summary is that all this comes from; None if the file was walked over."""

    def learn(self, opcode: int, content: memoryview) -> None:
        """Take in a schema, channel or index record."""
        if opcode == records.SCHEMA:
            schema = parsing.parse_schema(content)
            self.schemas.setdefault(schema.id, schema)
        elif opcode == records.CHANNEL:
            channel = parsing.parse_channel(content)
            self.channels.setdefault(channel.id, channel)
        elif opcode == records.CHUNK_INDEX:
            self.chunks.append(parsing.parse_chunk_index(content))
        elif opcode == records.ATTACHMENT_INDEX:
            self.attachments.append(parsing.parse_attachment_index(content))
        elif opcode == records.METADATA_INDEX:
            self.metadata.append(parsing.parse_metadata_index(content))
        elif opcode == records.STATISTICS:
            self.statistics = parsing.parse_statistics(content)


def load_index(source: FileSource, limits: Limits = LIMITS) -> FileIndex:
    """The table of contents of `source`.

    A file without a usable summary is walked record by record, and the problem noted. Raises
    `SessionError` if not even the first record is whole.
    """
    from seamlog.mcap.scan import scan

    index = FileIndex()
    try:
        start = _summary_start(source)
    except Malformed as error:
        return scan(source, f"{source.path} is not finished ({error})", limits)
    if start == 0:
        return scan(source, "", limits)
    try:
        _read_summary(source, start, index, limits)
    except Malformed as error:
        reason = f"{source.path}: the summary at byte {start} is damaged ({error})"
        return scan(source, reason, limits)
    if index.statistics.message_count and not index.chunks:
        return scan(source, "", limits)
    index.summary_start, index.expected = start, dict(index.statistics.channel_counts)
    try:
        index.profile, index.library = read_header(source)
    except SessionError as error:
        index.problems.append(str(error))
    return index


def read_header(source: FileSource) -> tuple[str, str]:
    """Profile and library of a file; `SessionError` if it is cut inside its first record."""
    at = len(records.MAGIC)
    try:
        if source.data[:at] != records.MAGIC:
            raise Malformed("the magic bytes are wrong")
        for opcode, offset, length in walk(source.data, at, source.size):
            if opcode != records.HEADER:
                break
            return parsing.parse_header(source.content(offset, length, opcode))
        raise Malformed("no header record")
    except Malformed as error:
        raise SessionError(
            f"{source.path}: damaged or cut at byte {at}, before its first chunk ({error}); "
            "there is nothing to read"
        ) from error


def walk(data: memoryview, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, offset and whole length of each record; `Malformed` at one that is not whole."""
    at, head = start, records.RECORD_HEAD
    while at < end:
        if at + head.size > end:
            raise Malformed(f"{end - at} bytes at byte {at} are no whole record")
        opcode, length = head.unpack_from(data, at)
        if opcode == 0 or length > end - at - head.size:
            raise Malformed(f"the record at byte {at} is not whole")
        yield opcode, at, length + head.size
        at += length + head.size


def _summary_start(source: FileSource) -> int:
    data, end = source.data, source.size - len(records.MAGIC)
    if source.size < 2 * len(records.MAGIC) + records.FOOTER_BYTES:
        raise Malformed("it ends before a footer could be there")
    if data[end:] != records.MAGIC:
        raise Malformed("it does not end with the magic bytes of MCAP")
    foot = source.content(end - records.FOOTER_BYTES, records.FOOTER_BYTES, records.FOOTER)
    start = parsing.Cursor(foot).u64()
    if start and not len(records.MAGIC) <= start <= end - records.FOOTER_BYTES:
        raise Malformed(f"its footer points outside the file, at byte {start}")
    return start


def _read_summary(source: FileSource, start: int, index: FileIndex, limits: Limits) -> None:
    end = source.size - records.END_BYTES
    if end - start > limits.summary_bytes:
        raise Malformed(f"{end - start} bytes are more than summary_bytes = {limits.summary_bytes}")
    data = source.data
    stored = parsing.Cursor(data, source.size - len(records.MAGIC) - 4).u32()
    if stored and crc32(data[start : source.size - len(records.MAGIC) - 4]) != stored:
        raise Malformed("its CRC is wrong")
    most_chunks = start // _LEAST_CHUNK_BYTES
    for opcode, offset, length in walk(data, start, end):
        index.learn(opcode, data[offset + records.RECORD_HEAD.size : offset + length])
        if len(index.chunks) > most_chunks:
            raise Malformed("its index lists more chunks than fit into the file")
    _check_entries(source, index.chunks)
    most = limits.chunk_bytes
    try:
        check_expansion(
            source, sum(min(row.uncompressed_size, most) for row in index.chunks), limits
        )
    except LimitExceeded as error:
        raise Malformed(str(error)) from error


def _check_entries(source: FileSource, chunks: list[ChunkEntry]) -> None:
    reached = len(records.MAGIC)
    for entry in sorted(chunks, key=lambda entry: entry.offset):
        if entry.offset < reached or entry.offset + entry.length > source.size:
            raise Malformed(f"the chunk at byte {entry.offset} overlaps another or leaves the file")
        reached = entry.offset + entry.length
