"""The session that a recovery writes: proved bytes copied as they are, nothing signed anew."""

from collections.abc import Mapping
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from seamlog import __version__
from seamlog.channels import CHANNELS
from seamlog.mcap import parsing, records
from seamlog.mcap.chunks import BARE
from seamlog.mcap.index import FileIndex
from seamlog.mcap.records import Buffer, ChunkEntry
from seamlog.mcap.source import FileSource
from seamlog.mcap.writer import FileWriter, message_index
from seamlog.messages import definition

from .ring import RECORD

_PIECE_BYTES = 4 << 20
_SEQUENCE = slice(RECORD.size - 20, RECORD.size - 16)
_REMEMBERED = 4
"""Chunks of a channel whose sequences are remembered: what a dying recorder wrote last."""


class RecoveredFile:
    """Takes whole chunks of a damaged file, then what rings still hold."""

    def __init__(self, file: IO[bytes], index: FileIndex) -> None:
        self._writer = FileWriter(
            file, index.library or f"seamlog {__version__}", index.profile or "ros2"
        )
        self._metadata: list[tuple[str, dict[str, str]]] = []
        self._defined: set[int] = set()
        self._add_channels(index)
        self._written: dict[int, list[set[int]]] = {}
        self.known = set(index.channels)
        """Channels whose topic is known."""
        self.counts: dict[int, int] = {}
        self.newest_ns = 0

    def _add_channels(self, index: FileIndex) -> None:
        for schema in index.schemas.values():
            self._writer.add_schema(schema.name, schema.data, schema.encoding, schema.id)
        for row in index.channels.values():
            schema_id = row.schema_id if row.schema_id in index.schemas else 0
            self._writer.add_channel(
                row.topic, schema_id, row.metadata, row.message_encoding, row.id
            )
        self._defined |= set(index.channels)

    def _define(self, numbers: list[int]) -> None:
        """Give channels whose record is gone one of their own: no reader takes messages without."""
        for number in numbers:
            if number not in self._defined:
                self._writer.add_channel(f"/recovered/channel_{number}", 0, {}, "", number)
                self._defined.add(number)

    def copy_chunk(
        self, source: FileSource, entry: ChunkEntry, offsets: NDArray[np.int64], heads: NDArray[Any]
    ) -> None:
        """Copy a proved chunk with its own CRC; times and message indexes come from its messages.

        Messages that stood outside chunks go into chunks without CRC: nothing ever proved them.
        """
        if not len(heads):
            return
        if entry.compression == BARE:
            data = source.data[entry.offset : entry.offset + entry.length]
            self.write_unproved(data, offsets, heads)
            return
        content = source.data[entry.offset + records.RECORD_HEAD.size :][
            : entry.length - records.RECORD_HEAD.size
        ]
        head = parsing.parse_chunk_head(content)
        body = content[head.data_offset :]
        self._put(body, head.compression, head.uncompressed_size, head.crc, offsets, heads)

    def write_unproved(self, data: Buffer, offsets: NDArray[np.int64], heads: NDArray[Any]) -> None:
        """Write message records that no CRC proves, as chunks that carry none."""
        ends = offsets + heads["length"].astype(np.int64) + records.RECORD_HEAD.size
        first = 0
        while first < len(offsets):
            start = int(offsets[first])
            last = max(first + 1, int(np.searchsorted(ends, start + _PIECE_BYTES)))
            piece = memoryview(data)[start : int(ends[last - 1])]
            part = slice(first, last)
            self._put(piece, "", len(piece), 0, offsets[part] - start, heads[part])
            first = last

    def _put(
        self,
        body: Buffer,
        compression: str,
        size: int,
        crc: int,
        offsets: NDArray[np.int64],
        heads: NDArray[Any],
    ) -> None:
        times = heads["log_time"]
        start, end = int(times.min()), int(times.max())
        front = records.chunk_head(start, end, size, crc, compression, len(body))
        length = len(front) + len(body)
        numbers = np.unique(heads["channel"]).tolist()
        self._define(numbers)
        mine = {number: heads["channel"] == number for number in numbers}
        packed = [
            message_index(n, times[rows], offsets[rows].astype(np.uint64))
            for n, rows in mine.items()
        ]
        ends = np.cumsum([length, *map(len, packed)]).tolist()
        places = dict(zip(numbers, ends, strict=False))
        entry = ChunkEntry(
            start, end, 0, length, places, ends[-1] - length, compression, len(body), size
        )
        counts = {number: int(rows.sum()) for number, rows in mine.items()}
        self._writer.copy_chunk(entry, b"".join((front, body, *packed)), counts)
        for number, rows in mine.items():
            self._remember(number, heads["sequence"][rows].tolist(), end)

    def _remember(self, channel_id: int, sequences: list[int], end_ns: int) -> None:
        self.counts[channel_id] = self.counts.get(channel_id, 0) + len(sequences)
        self.newest_ns = max(self.newest_ns, end_ns)
        last = self._written.setdefault(channel_id, [])
        last.append(set(sequences))
        del last[:-_REMEMBERED]

    def last_sequence(self, channel_id: int) -> int:
        """The newest sequence of a channel, -1 without messages."""
        return max((max(row) for row in self._written.get(channel_id, [])[-1:]), default=-1)

    def copy_attachment(self, source: FileSource, entry: records.AttachmentEntry) -> None:
        """Copy an attachment as it is."""
        raw = source.data[entry.offset : entry.offset + entry.length]
        self._writer.copy_attachment(entry, raw)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record, once."""
        if (name, dict(values)) not in self._metadata:
            self._metadata.append((name, dict(values)))
            self._writer.add_metadata(name, values)

    def attach(self, name: str, data: bytes, media_type: str, log_time_ns: int) -> None:
        """Write an attachment that came from the loop and never was in a file."""
        self._writer.add_attachment(name, data, media_type, log_time_ns, log_time_ns)

    def add_channel(self, topic: str, channel_id: int, metadata: Mapping[str, str]) -> None:
        """Take in a channel of the table unless the file has it."""
        if channel_id not in self._defined:
            row = CHANNELS[topic]
            schema = self._writer.schema_id(row.schema, definition(row))
            self._writer.add_channel(topic, schema, metadata, "cdr", channel_id)
            self.known.add(channel_id)
            self._defined.add(channel_id)

    def write_chunk(
        self,
        channel_id: int,
        data: Buffer,
        log_times_ns: NDArray[np.uint64],
        offsets: NDArray[np.uint64],
        compression: str,
    ) -> bool:
        """Write messages of a ring; those that the dying recorder had just written are left out."""
        view = memoryview(data).cast("B")
        starts = offsets.tolist()
        known: set[int] = set().union(*self._written.get(channel_id, []))
        sequences = [int.from_bytes(view[at:][_SEQUENCE], "little") for at in starts]
        new = np.array([sequence not in known for sequence in sequences], np.bool_)
        if not new.all():
            ends = [*starts[1:], len(view)]
            pairs = zip(starts, ends, new.tolist(), strict=True)
            pieces = [bytes(view[at:end]) for at, end, wanted in pairs if wanted]
            data = b"".join(pieces)
            offsets = np.cumsum([0, *map(len, pieces)], dtype=np.uint64)[:-1]
            log_times_ns = log_times_ns[new]
        if len(offsets):
            self._writer.write_chunk(channel_id, data, log_times_ns, offsets, compression)
            kept = [s for s, wanted in zip(sequences, new.tolist(), strict=True) if wanted]
            self._remember(channel_id, kept, int(log_times_ns.max()))
        return True

    def finish(self) -> None:
        """Write the summary."""
        self._writer.finish()
