"""Records of an MCAP file and how each is built (mcap.dev/spec, version 0).

A record is one byte of opcode, eight of length and the content; all numbers little endian.
`seamlog.mcap.parsing` reads them.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

Buffer: TypeAlias = bytes | bytearray | memoryview

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX = range(9, 14)
SUMMARY_OFFSET, DATA_END = 14, 15

RECORD_HEAD = struct.Struct("<BQ")
CHUNK_TIMES = struct.Struct("<QQQI")
FOOTER_BYTES = RECORD_HEAD.size + 20
END_BYTES = FOOTER_BYTES + len(MAGIC)
STATISTICS_HEAD = struct.Struct("<QHIIIIQQ")


class Malformed(ValueError):
    """A record's content does not fit its length; readers turn it into a `SessionError`."""


@dataclass(frozen=True, slots=True)
class Schema:
    """A message definition; `encoding` is `ros2msg` in our own files."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True)
class ChannelRecord:
    """A topic of a file, `schema_id` 0 if it has no schema."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str
    metadata: Mapping[str, str]


class ChunkHead(NamedTuple):
    """What a chunk says about itself, in front of its data."""

    start_ns: int
    end_ns: int
    uncompressed_size: int
    crc: int
    compression: str
    data_offset: int
    """Bytes from the start of the chunk's content to its data."""
    data_size: int


class ChunkEntry(NamedTuple):
    """One row of the chunk index; offsets are bytes from the start of the file."""

    start_ns: int
    end_ns: int
    offset: int
    length: int
    """Bytes of the whole chunk record."""
    index_offsets: Mapping[int, int]
    """Channel id to the offset of its message index; empty if there is none."""
    index_length: int
    compression: str
    compressed_size: int
    uncompressed_size: int


class AttachmentEntry(NamedTuple):
    """One row of the attachment index."""

    offset: int
    length: int
    log_time_ns: int
    create_time_ns: int
    data_size: int
    name: str
    media_type: str


class MetadataEntry(NamedTuple):
    """One row of the metadata index."""

    offset: int
    length: int
    name: str


@dataclass(slots=True)
class Statistics:
    """Counts of a whole file; times are 0 when there is no message."""

    message_count: int = 0
    start_ns: int = 0
    end_ns: int = 0
    chunk_count: int = 0
    channel_counts: dict[int, int] = field(default_factory=dict)

    def add(self, channel_id: int, count: int, start_ns: int, end_ns: int) -> None:
        """Take in `count` (> 0) messages of one channel."""
        self.start_ns = min(self.start_ns, start_ns) if self.message_count else start_ns
        self.end_ns = max(self.end_ns, end_ns)
        self.message_count += count
        self.channel_counts[channel_id] = self.channel_counts.get(channel_id, 0) + count


def record(opcode: int, *parts: bytes) -> bytes:
    """A whole record."""
    content = b"".join(parts)
    return RECORD_HEAD.pack(opcode, len(content)) + content


def pack_string(text: str) -> bytes:
    """Length (uint32) and UTF-8 bytes."""
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def pack_map(mapping: Mapping[str, str]) -> bytes:
    """A string map: its length in bytes, then keys and values, sorted by key."""
    items = sorted(mapping.items())
    body = b"".join(pack_string(key) + pack_string(value) for key, value in items)
    return struct.pack("<I", len(body)) + body


def header(profile: str, library: str) -> bytes:
    """The first record of a file."""
    return record(HEADER, pack_string(profile), pack_string(library))


def schema(row: Schema) -> bytes:
    """A schema record."""
    names = pack_string(row.name) + pack_string(row.encoding)
    return record(
        SCHEMA, struct.pack("<H", row.id), names, struct.pack("<I", len(row.data)), row.data
    )


def channel(row: ChannelRecord) -> bytes:
    """A channel record."""
    names = pack_string(row.topic) + pack_string(row.message_encoding)
    return record(CHANNEL, struct.pack("<HH", row.id, row.schema_id), names, pack_map(row.metadata))


def chunk_head(
    start_ns: int, end_ns: int, size: int, crc: int, compression: str, data_size: int
) -> bytes:
    """Everything of a chunk record in front of its data, opcode and length included."""
    head = CHUNK_TIMES.pack(start_ns, end_ns, size, crc) + pack_string(compression)
    head += struct.pack("<Q", data_size)
    return RECORD_HEAD.pack(CHUNK, len(head) + data_size) + head


def chunk_index(row: ChunkEntry) -> bytes:
    """A chunk index record."""
    offsets = row.index_offsets.items()
    packed = b"".join(struct.pack("<HQ", *item) for item in offsets)
    return record(
        CHUNK_INDEX,
        struct.pack("<QQQQI", row.start_ns, row.end_ns, row.offset, row.length, len(packed)),
        packed,
        struct.pack("<Q", row.index_length),
        pack_string(row.compression),
        struct.pack("<QQ", row.compressed_size, row.uncompressed_size),
    )


def attachment_index(row: AttachmentEntry) -> bytes:
    """An attachment index record."""
    numbers = struct.pack("<QQQQQ", *row[:5])
    return record(ATTACHMENT_INDEX, numbers, pack_string(row.name), pack_string(row.media_type))


def metadata(name: str, mapping: Mapping[str, str]) -> bytes:
    """A metadata record."""
    return record(METADATA, pack_string(name), pack_map(mapping))


def metadata_index(row: MetadataEntry) -> bytes:
    """A metadata index record."""
    return record(METADATA_INDEX, struct.pack("<QQ", row.offset, row.length), pack_string(row.name))


def statistics(
    row: Statistics, schemas: int, channels: int, attachments: int, metadata_records: int
) -> bytes:
    """A statistics record; the four numbers count records of the file."""
    counts = b"".join(struct.pack("<HQ", *item) for item in row.channel_counts.items())
    head = STATISTICS_HEAD.pack(
        row.message_count,
        schemas,
        channels,
        attachments,
        metadata_records,
        row.chunk_count,
        row.start_ns,
        row.end_ns,
    )
    return record(STATISTICS, head, struct.pack("<I", len(counts)), counts)


def summary_offset(opcode: int, start: int, length: int) -> bytes:
    """Where a group of summary records is."""
    return record(SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start, length))


def footer(summary_start: int, summary_offset_start: int) -> bytes:
    """The footer without its CRC: opcode, length and both offsets."""
    return RECORD_HEAD.pack(FOOTER, 20) + struct.pack("<QQ", summary_start, summary_offset_start)


def groups(rows: Sequence[tuple[int, Sequence[bytes]]], start: int) -> tuple[bytes, bytes]:
    """Summary records by opcode, and the summary offsets that point at the groups."""
    body, offsets = bytearray(), []
    for opcode, records in rows:
        if records:
            group = b"".join(records)
            offsets.append(summary_offset(opcode, start + len(body), len(group)))
            body += group
    return bytes(body), b"".join(offsets)
