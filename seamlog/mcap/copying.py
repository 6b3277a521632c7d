"""Copies the chunks of one file into another, as they are wherever the channel ids allow it."""

import struct
from collections.abc import Collection

import numpy as np

from seamlog.mcap import records
from seamlog.mcap.attachments import read_attachment
from seamlog.mcap.chunks import BARE
from seamlog.mcap.file import McapFile
from seamlog.mcap.index import walk
from seamlog.mcap.message_index import index_count
from seamlog.mcap.records import ChunkEntry
from seamlog.mcap.writer import FileWriter

_HEAD = records.RECORD_HEAD.size


def copy_file(file: McapFile, writer: FileWriter, leave_out: Collection[str] = ()) -> None:
    """Copy channels, chunks and attachments; each chunk is proved by its CRC first.

    A damaged chunk is left out and noted among the problems of `file`. `leave_out` names
    attachments that are not copied.
    """
    ids = _Ids(file, writer)
    for entry in file.index.chunks:
        for chunk in file.iter_chunks([entry]):
            _copy_chunk(file, entry, chunk.data, writer, ids)
    copy_attachments(file, writer, leave_out)


def copy_attachments(file: McapFile, writer: FileWriter, leave_out: Collection[str] = ()) -> None:
    """Copy the attachments but those named in `leave_out`."""
    for row in file.index.attachments:
        if row.name not in leave_out:
            held = read_attachment(file.source, row, file.limits)
            writer.add_attachment(
                held.name, held.data, held.media_type, held.log_time_ns, held.create_time_ns
            )


class _Ids:
    """Channel and schema ids of a file and what they are in the new one."""

    def __init__(self, file: McapFile, writer: FileWriter) -> None:
        self.schemas = {0: 0}
        for schema in file.index.schemas.values():
            self.schemas[schema.id] = writer.schema_id(
                schema.name, schema.data, schema.encoding, wanted=schema.id
            )
        self.channels = {}
        for row in file.index.channels.values():
            self.channels[row.id] = writer.channel_id(
                row.topic,
                self.schemas[row.schema_id],
                row.metadata,
                row.message_encoding,
                wanted=row.id,
            )
        self.are_same = all(old == new for old, new in self.schemas.items()) and all(
            old == new for old, new in self.channels.items()
        )


def _copy_chunk(
    file: McapFile, entry: ChunkEntry, data: memoryview, writer: FileWriter, ids: _Ids
) -> None:
    counts = _counts(file, entry)
    if not ids.are_same or not counts or entry.compression == BARE:
        _copy_anew(entry, data, writer, ids)
        return
    end = entry.offset + entry.length + entry.index_length
    writer.copy_chunk(entry, file.source.data[entry.offset : end], counts)


def _counts(file: McapFile, entry: ChunkEntry) -> dict[int, int]:
    """Messages by channel id; empty if the message indexes do not follow the chunk."""
    behind = range(entry.offset + entry.length, entry.offset + entry.length + entry.index_length)
    counts = {}
    for number, offset in entry.index_offsets.items():
        count = index_count(file.source, entry, number)
        if not count or offset not in behind:
            return {}
        counts[number] = count
    return counts


def _copy_anew(entry: ChunkEntry, data: memoryview, writer: FileWriter, ids: _Ids) -> None:
    """Write the records of a chunk with new ids and new message indexes."""
    copy = bytearray(data)
    found: dict[int, tuple[list[int], list[int]]] = {}
    for opcode, offset, _ in walk(data, 0, len(data)):
        at = offset + _HEAD
        if opcode == records.MESSAGE:
            number = ids.channels[_id(copy, at)]
            struct.pack_into("<H", copy, at, number)
            times, offsets = found.setdefault(number, ([], []))
            times.append(int.from_bytes(copy[at + 6 : at + 14], "little"))
            offsets.append(offset)
        elif opcode == records.SCHEMA:
            struct.pack_into("<H", copy, at, ids.schemas[_id(copy, at)])
        elif opcode == records.CHANNEL:
            struct.pack_into("<H", copy, at, ids.channels[_id(copy, at)])
            struct.pack_into("<H", copy, at + 2, ids.schemas[_id(copy, at + 2)])
    if not found:
        return
    indexes = {
        number: (np.array(times, np.uint64), np.array(offsets, np.uint64))
        for number, (times, offsets) in found.items()
    }
    compression = "" if entry.compression == BARE else entry.compression
    writer.write_records(copy, indexes, compression)


def _id(data: bytearray, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "little")
