"""Parses the records of an MCAP file.

Parsing is bounded: whatever does not fit its record raises `Malformed`, never an index error.
"""

import struct

from seamlog.mcap.records import (
    CHUNK_TIMES,
    STATISTICS_HEAD,
    AttachmentEntry,
    Buffer,
    ChannelRecord,
    ChunkEntry,
    ChunkHead,
    Malformed,
    MetadataEntry,
    Schema,
    Statistics,
)


class Cursor:
    """Reads one record's content from the front, never beyond its end."""

    __slots__ = ("_data", "at")

    def __init__(self, data: Buffer, at: int = 0) -> None:
        self._data = memoryview(data)
        self.at = at

    @property
    def left(self) -> int:
        """Bytes not read yet."""
        return len(self._data) - self.at

    def unpack(self, form: struct.Struct) -> tuple[int, ...]:
        """The values of `form` here."""
        start = self.at
        self._step(form.size)
        return form.unpack_from(self._data, start)

    def take(self, size: int) -> memoryview:
        """The next `size` bytes."""
        start = self.at
        self._step(size)
        return self._data[start : self.at]

    def _step(self, size: int) -> None:
        if size > self.left:
            raise Malformed(f"{size} bytes wanted where {self.left} are left")
        self.at += size

    def align(self, width: int) -> None:
        """Skip to the next multiple of `width`, as CDR pads."""
        self._step(-self.at % width)

    def u16(self) -> int:
        """The next uint16."""
        return self.unpack(_U16)[0]

    def u32(self) -> int:
        """The next uint32."""
        return self.unpack(_U32)[0]

    def u64(self) -> int:
        """The next uint64."""
        return self.unpack(_U64)[0]

    def string(self) -> str:
        """The next string."""
        return _text(self.take(self.u32()))

    def string_map(self) -> dict[str, str]:
        """The next map of strings."""
        inner = Cursor(self.take(self.u32()))
        found = {}
        while inner.left:
            key = inner.string()
            found[key] = inner.string()
        return found

    def u16_to_u64(self) -> dict[int, int]:
        """The next map of uint16 to uint64."""
        body = self.take(self.u32())
        if len(body) % 10:
            raise Malformed("a map of offsets is no multiple of 10 bytes")
        return dict(struct.iter_unpack("<HQ", body))


def _text(data: Buffer) -> str:
    try:
        return str(data, "utf-8")
    except UnicodeDecodeError as error:
        raise Malformed(f"a string is not UTF-8: {error.reason}") from error


_U16, _U32, _U64 = struct.Struct("<H"), struct.Struct("<I"), struct.Struct("<Q")
_ENTRY = struct.Struct("<QQQQ")
_TIMES = struct.Struct("<QQ")


def parse_header(content: Buffer) -> tuple[str, str]:
    """Profile and library."""
    cursor = Cursor(content)
    return cursor.string(), cursor.string()


def parse_schema(content: Buffer) -> Schema:
    """A schema."""
    cursor = Cursor(content)
    return Schema(cursor.u16(), cursor.string(), cursor.string(), bytes(cursor.take(cursor.u32())))


def parse_channel(content: Buffer) -> ChannelRecord:
    """A channel."""
    cursor = Cursor(content)
    number, schema_id = cursor.u16(), cursor.u16()
    return ChannelRecord(number, schema_id, cursor.string(), cursor.string(), cursor.string_map())


def parse_chunk_head(content: Buffer) -> ChunkHead:
    """The head of a chunk; `content` need not hold the data."""
    cursor = Cursor(content)
    start, end, size, crc = cursor.unpack(CHUNK_TIMES)
    compression = cursor.string()
    data_size = cursor.u64()
    return ChunkHead(start, end, size, crc, compression, cursor.at, data_size)


_ONE_CHANNEL = struct.Struct("<QQQQIHQQI")
_SIZES = struct.Struct("<QQ")


def parse_chunk_index(content: Buffer) -> ChunkEntry:
    """A row of the chunk index."""
    if len(content) >= _ONE_CHANNEL.size:
        start, end, offset, length, size, channel_id, at, behind, name = _ONE_CHANNEL.unpack_from(
            content
        )
        if size == 10 and len(content) == _ONE_CHANNEL.size + name + _SIZES.size:
            packed, unpacked = _SIZES.unpack_from(content, _ONE_CHANNEL.size + name)
            compression = _text(content[_ONE_CHANNEL.size : _ONE_CHANNEL.size + name])
            places = {channel_id: at}
            return ChunkEntry(
                start, end, offset, length, places, behind, compression, packed, unpacked
            )
    return _parse_chunk_index(content)


def _parse_chunk_index(content: Buffer) -> ChunkEntry:
    cursor = Cursor(content)
    start, end, offset, length = cursor.unpack(_ENTRY)
    offsets = cursor.u16_to_u64()
    index_length = cursor.u64()
    compression = cursor.string()
    packed, unpacked = cursor.unpack(_TIMES)
    return ChunkEntry(
        start, end, offset, length, offsets, index_length, compression, packed, unpacked
    )


def parse_attachment_index(content: Buffer) -> AttachmentEntry:
    """A row of the attachment index."""
    cursor = Cursor(content)
    offset, length, log_time, create_time = cursor.unpack(_ENTRY)
    size = cursor.u64()
    name = cursor.string()
    return AttachmentEntry(offset, length, log_time, create_time, size, name, cursor.string())


def parse_metadata_index(content: Buffer) -> MetadataEntry:
    """A row of the metadata index."""
    cursor = Cursor(content)
    return MetadataEntry(cursor.u64(), cursor.u64(), cursor.string())


def parse_metadata(content: Buffer) -> tuple[str, dict[str, str]]:
    """Name and values of a metadata record."""
    cursor = Cursor(content)
    return cursor.string(), cursor.string_map()


def parse_statistics(content: Buffer) -> Statistics:
    """The statistics of a file."""
    cursor = Cursor(content)
    messages, _, _, _, _, chunks, start, end = cursor.unpack(STATISTICS_HEAD)
    return Statistics(messages, start, end, chunks, cursor.u16_to_u64())
