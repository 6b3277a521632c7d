"""Writes MCAP files chunk by chunk: whole message records of one channel go in, a file comes out.

Numbers of messages per chunk are handled by numpy, one `os.writev` writes a chunk with its
message index. `FileWriter.size` counts whole records only: after an `OSError` everything up to
there is a valid prefix, and the caller may truncate the file to it and go on elsewhere.
"""

import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import IO

import numpy as np
from numpy.typing import NDArray

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
        self.statistics = Statistics()
        self._write([records.MAGIC + records.header(profile, library)])

    @property
    def size(self) -> int:
        """Bytes of whole records written so far."""
        return self._size

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
        body = compress(_joined(head, data, compression), compression)
        crc = zlib.crc32(data, zlib.crc32(head))
        pieces = [head, body] if compression == "" and head else [body]
        size = len(head) + len(data)
        start, end = int(log_times_ns.min()), int(log_times_ns.max())
        stored = sum(len(piece) for piece in pieces)
        front = records.chunk_head(start, end, size, crc, compression, stored)
        index = _message_index(channel_id, log_times_ns, offsets, len(head))
        chunk_length = len(front) + stored
        at = self._size
        self._write([front, *pieces, index])
        entry = ChunkEntry(
            start,
            end,
            at,
            chunk_length,
            {channel_id: at + chunk_length},
            len(index),
            compression,
            stored,
            size,
        )
        self._introduced.add(channel_id)
        self._note(entry, {channel_id: len(offsets)})

    def copy_chunk(self, entry: ChunkEntry, raw: Buffer, counts: Mapping[int, int]) -> None:
        """Copy a chunk of another file as it is: `raw` is its record and its message indexes.

        The channels must be known here under the same ids; `counts` are messages by channel id.
        """
        shift = self._size - entry.offset
        moved = {number: offset + shift for number, offset in entry.index_offsets.items()}
        self._write([raw])
        self._note(entry._replace(offset=entry.offset + shift, index_offsets=moved), counts)

    def _note(self, entry: ChunkEntry, counts: Mapping[int, int]) -> None:
        self._chunks.append(records.chunk_index(entry))
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
        crc = struct.pack("<I", zlib.crc32(data, zlib.crc32(head)))
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
        crc = struct.pack("<I", zlib.crc32(summary))
        self._write([data_end, summary, crc, records.MAGIC])

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


def _message_index(
    channel_id: int, log_times_ns: NDArray[np.uint64], offsets: NDArray[np.uint64], shift: int
) -> bytes:
    rows = np.empty((len(offsets), 2), "<u8")
    rows[:, 0] = log_times_ns
    np.add(offsets, np.uint64(shift), out=rows[:, 1], casting="unsafe")
    head = struct.pack("<HI", channel_id, rows.nbytes)
    return records.record(records.MESSAGE_INDEX, head, rows.tobytes())
