"""Writes MCAP files chunk by chunk: whole message records of one channel go in, a file comes out.

Numbers of messages per chunk are handled by numpy, one `os.writev` writes a chunk with its
message index. `FileWriter.size` counts whole records only: after an `OSError` everything up to
there is a valid prefix, and the caller may truncate the file to it and go on elsewhere.
"""

import os
import struct
from collections.abc import Mapping, Sequence
from typing import IO, TypeAlias

import numpy as np
from numpy.typing import NDArray
from zlib_ng.zlib_ng import crc32

from seamlog.mcap import records
from seamlog.mcap.compression import compress
from seamlog.mcap.records import (
    AttachmentEntry,
    Buffer,
    ChannelRecord,
    ChunkEntry,
    MetadataEntry,
    Schema,
    Statistics,
)

MessageIndex: TypeAlias = tuple[NDArray[np.uint64], NDArray[np.uint64]]
"""Log times and offsets of messages."""


class FileWriter:
    """One MCAP file being written; belongs to one thread.

    `file` is an empty unbuffered binary file, open for writing. Nothing is synced here.
    """

    def __init__(self, file: IO[bytes], library: str, profile: str = "ros2") -> None:
        self._fd = file.fileno()
        self._size = 0
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, ChannelRecord] = {}
        self._heads: dict[int, bytes] = {}
        self._introduced: set[int] = set()
        self._chunks: list[bytes] = []
        self._attachments: list[AttachmentEntry] = []
        self._metadata: list[MetadataEntry] = []
        self._chunk_index_bytes = 0
        self.statistics = Statistics()
        self._write([records.MAGIC + records.header(profile, library)])

    @property
    def size(self) -> int:
        """Bytes of whole records written so far."""
        return self._size

    @property
    def summary_size(self) -> int:
        """About how many bytes `finish` will write, rather too many than too few."""
        heads = 2 * sum(len(head) for head in self._heads.values())
        rows = 400 * (len(self._attachments) + len(self._metadata) + 1)
        return heads + rows + self._chunk_index_bytes

    def add_schema(
        self, name: str, text: str | bytes, encoding: str = "ros2msg", schema_id: int | None = None
    ) -> int:
        """Take in a message definition; the id is the next free one unless given."""
        number = _free_id(self._schemas, schema_id)
        data = text.encode() if isinstance(text, str) else text
        self._schemas[number] = Schema(number, name, encoding, data)
        return number

    def add_channel(
        self,
        topic: str,
        schema_id: int,
        metadata: Mapping[str, str],
        message_encoding: str = "cdr",
        channel_id: int | None = None,
    ) -> int:
        """Take in a channel; the id is the next free one unless given.

        `KeyError` if `schema_id` is neither 0 nor known.
        """
        number = _free_id(self._channels, channel_id)
        head = records.schema(self._schemas[schema_id]) if schema_id else b""
        row = ChannelRecord(number, schema_id, topic, message_encoding, dict(metadata))
        self._channels[number] = row
        self._heads[number] = head + records.channel(row)
        return number

    def schema_id(
        self, name: str, text: str | bytes, encoding: str = "ros2msg", wanted: int | None = None
    ) -> int:
        """The id of a message definition, taken in (as `wanted` if free) unless it is known."""
        data = text.encode() if isinstance(text, str) else text
        for row in self._schemas.values():
            if (row.name, row.encoding, row.data) == (name, encoding, data):
                return row.id
        return self.add_schema(name, data, encoding, None if wanted in self._schemas else wanted)

    def channel_id(
        self,
        topic: str,
        schema_id: int,
        metadata: Mapping[str, str],
        message_encoding: str = "cdr",
        wanted: int | None = None,
    ) -> int:
        """The id of a channel, taken in (as `wanted` if free) unless it is known."""
        known = (topic, schema_id, message_encoding, dict(metadata))
        for row in self._channels.values():
            if (row.topic, row.schema_id, row.message_encoding, row.metadata) == known:
                return row.id
        number = None if wanted in self._channels else wanted
        return self.add_channel(topic, schema_id, metadata, message_encoding, number)

    def write_chunk(
        self,
        channel_id: int,
        data: Buffer,
        log_times_ns: NDArray[np.uint64],
        offsets: NDArray[np.uint64],
        compression: str = "zstd",
        standalone: bool = True,
    ) -> None:
        """Write whole Message records of one channel as a chunk with its message index.

        `offsets` are those of the records in `data`, in order, as are `log_times_ns`. The schema
        and channel records stand in front of them: always if `standalone`, else only in the
        first chunk of the channel.
        """
        if not len(offsets):
            return
        lead = standalone or channel_id not in self._introduced
        head = self._heads[channel_id] if lead else b""
        self._introduced.add(channel_id)
        shifted = np.add(offsets, np.uint64(len(head)), casting="unsafe")
        self._put_chunk((head, data), compression, {channel_id: (log_times_ns, shifted)})

    def write_records(
        self, data: Buffer, indexes: Mapping[int, MessageIndex], compression: str
    ) -> None:
        """Write a chunk of any records as they are; `indexes` by channel id, offsets in `data`."""
        self._put_chunk((b"", data), compression, indexes)

    def _put_chunk(
        self, parts: tuple[bytes, Buffer], compression: str, indexes: Mapping[int, MessageIndex]
    ) -> None:
        head, data = parts
        body = compress(_joined(head, data, compression), compression)
        pieces = [head, body] if head and not compression else [body]
        crc = crc32(data, crc32(head))
        size, stored = len(head) + len(data), sum(len(piece) for piece in pieces)
        start = min(int(times.min()) for times, _ in indexes.values())
        end = max(int(times.max()) for times, _ in indexes.values())
        front = records.chunk_head(start, end, size, crc, compression, stored)
        length = len(front) + stored
        packed = [message_index(number, *rows) for number, rows in indexes.items()]
        ends = np.cumsum([self._size + length, *map(len, packed)]).tolist()
        places = dict(zip(indexes, ends, strict=False))
        entry = ChunkEntry(
            start,
            end,
            self._size,
            length,
            places,
            ends[-1] - ends[0],
            compression,
            stored,
            size,
        )
        self._write([front, *pieces, *packed])
        self._note(entry, {number: len(times) for number, (times, _) in indexes.items()})

    def copy_chunk(self, entry: ChunkEntry, raw: Buffer, counts: Mapping[int, int]) -> None:
        """Copy a chunk of another file as it is: `raw` is its record and its message indexes.

        The channels must be known here under the same ids; `counts` are messages by channel id.
        """
        shift = self._size - entry.offset
        moved = {number: offset + shift for number, offset in entry.index_offsets.items()}
        self._write([raw])
        self._note(entry._replace(offset=entry.offset + shift, index_offsets=moved), counts)

    def copy_attachment(self, entry: AttachmentEntry, raw: Buffer) -> None:
        """Copy an attachment of another file as it is, with the CRC it has: `raw` is its record."""
        at = self._size
        self._write([raw])
        self._attachments.append(entry._replace(offset=at))

    def _note(self, entry: ChunkEntry, counts: Mapping[int, int]) -> None:
        self._chunks.append(records.chunk_index(entry))
        self._chunk_index_bytes += len(self._chunks[-1])
        self.statistics.chunk_count += 1
        for number, count in counts.items():
            self.statistics.add(number, count, entry.start_ns, entry.end_ns)

    def add_attachment(
        self, name: str, data: Buffer, media_type: str, log_time_ns: int, create_time_ns: int = 0
    ) -> None:
        """Write a file into the session, with its CRC."""
        size = len(data)
        head = struct.pack("<QQ", log_time_ns, create_time_ns)
        head += records.pack_string(name) + records.pack_string(media_type)
        head += struct.pack("<Q", size)
        crc = struct.pack("<I", crc32(data, crc32(head)))
        front = records.RECORD_HEAD.pack(records.ATTACHMENT, len(head) + size + 4)
        at = self._size
        self._write([front, head, data, crc])
        row = (at, self._size - at, log_time_ns, create_time_ns, size, name, media_type)
        self._attachments.append(AttachmentEntry(*row))

    def add_metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Write a metadata record."""
        at = self._size
        self._write([records.metadata(name, mapping)])
        self._metadata.append(MetadataEntry(at, self._size - at, name))

    def finish(self) -> None:
        """Write the end of the data, the summary with its CRC and the footer."""
        data_end = records.record(records.DATA_END, struct.pack("<I", 0))
        start = self._size + len(data_end)
        body, offsets = records.groups(self._summary(), start)
        foot = records.footer(start if body else 0, start + len(body) if offsets else 0)
        summary = body + offsets + foot
        crc = struct.pack("<I", crc32(summary))
        self._write([data_end, summary, crc, records.MAGIC])
        # A recording may keep many finished files in mind.
        self._chunks.clear()

    def _summary(self) -> Sequence[tuple[int, Sequence[bytes]]]:
        counts = records.statistics(
            self.statistics,
            len(self._schemas),
            len(self._channels),
            len(self._attachments),
            len(self._metadata),
        )
        return (
            (records.SCHEMA, [records.schema(row) for row in self._schemas.values()]),
            (records.CHANNEL, [records.channel(row) for row in self._channels.values()]),
            (records.STATISTICS, [counts]),
            (records.CHUNK_INDEX, self._chunks),
            (records.ATTACHMENT_INDEX, [records.attachment_index(x) for x in self._attachments]),
            (records.METADATA_INDEX, [records.metadata_index(x) for x in self._metadata]),
        )

    def _write(self, pieces: Sequence[Buffer]) -> None:
        total = sum(len(piece) for piece in pieces)
        written = os.writev(self._fd, pieces)
        if written != total:
            self._write_rest(b"".join(pieces)[written:])
        self._size += total

    def _write_rest(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._fd, rest) :]


def _free_id(taken: Mapping[int, object], wanted: int | None) -> int:
    if wanted is None:
        return max(taken, default=0) + 1
    if wanted in taken:
        raise ValueError(f"id {wanted} is taken already")
    return wanted


def _joined(head: bytes, data: Buffer, compression: str) -> Buffer:
    return b"".join((head, data)) if head and compression else data


def message_index(
    channel_id: int, log_times_ns: NDArray[np.uint64], offsets: NDArray[np.uint64]
) -> bytes:
    """A message index record: the log times and the offsets of a channel in its chunk."""
    rows = np.empty((len(offsets), 2), "<u8")
    rows[:, 0] = log_times_ns
    rows[:, 1] = offsets
    head = struct.pack("<HI", channel_id, rows.nbytes)
    return records.record(records.MESSAGE_INDEX, head, rows.tobytes())
