"""Rewrites the messages of files into large chunks, one channel each; the records stay as they are.

Only ids of channels may change. Each chunk is proved by its CRC before it is read; messages keep
the order in which they were captured.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import IMAGE_SCHEMA
from seamlog.mcap.compression import NONE
from seamlog.mcap.file import McapFile
from seamlog.mcap.records import ChannelRecord
from seamlog.mcap.rows import Batch, iter_batches
from seamlog.mcap.writer import FileWriter

_CHUNK_BYTES = 2 << 20
_CHANNEL = 9
"""Offset of the channel id in a Message record."""


def compact_files(files: Sequence[McapFile], writer: FileWriter, compression: str) -> None:
    """Write all messages of `files` into chunks of 2 MiB."""
    parts: dict[int, list[tuple[McapFile, ChannelRecord]]] = {}
    for file in files:
        for row in file.index.channels.values():
            parts.setdefault(_new_id(file, row, writer), []).append((file, row))
    for number, sources in parts.items():
        file, row = sources[0]
        schema = file.index.schemas.get(row.schema_id)
        is_image = schema is not None and schema.name == IMAGE_SCHEMA
        packer = _Packer(writer, number, NONE if is_image else compression)
        for file, row in sources:
            packer.add_all(iter_batches(file.iter_chunks(file.entries(row.id)), row.id))
        packer.flush()


def _new_id(file: McapFile, row: ChannelRecord, writer: FileWriter) -> int:
    schema = file.index.schemas.get(row.schema_id)
    number = writer.schema_id(schema.name, schema.data, schema.encoding) if schema else 0
    return writer.channel_id(row.topic, number, row.metadata, row.message_encoding)


class _Packer:
    """Gathers the records of one channel until they fill a chunk."""

    def __init__(self, writer: FileWriter, number: int, compression: str) -> None:
        self._writer, self._number, self._compression = writer, number, compression
        self._pieces: list[memoryview] = []
        self._offsets: list[NDArray[np.int64]] = []
        self._times: list[NDArray[np.int64]] = []
        self._size = 0

    def add_all(self, batches: Iterable[Batch]) -> None:
        """Take the messages of batches, in order."""
        for batch in batches:
            offsets, lengths = batch.places()
            ends = np.cumsum(lengths)
            start = 0
            while start < len(offsets):
                reached = ends[start] - lengths[start] + _CHUNK_BYTES - self._size
                stop = max(start + 1, int(np.searchsorted(ends, reached)) + 1)
                self._add(batch, slice(start, stop))
                start = stop

    def _add(self, batch: Batch, part: slice) -> None:
        offsets, lengths = (places[part] for places in batch.places())
        whole = batch.data.data
        if int(offsets[-1] + lengths[-1] - offsets[0]) == int(lengths.sum()):
            pieces = [whole[int(offsets[0]) : int(offsets[-1] + lengths[-1])]]
        else:
            spans = zip(offsets.tolist(), lengths.tolist(), strict=True)
            pieces = [whole[at : at + size] for at, size in spans]
        self._pieces += pieces
        self._offsets.append(self._size + np.cumsum(lengths) - lengths)
        self._times.append(batch.log_times_ns()[part].copy())
        self._size += int(lengths.sum())
        if self._size >= _CHUNK_BYTES:
            self.flush()

    def flush(self) -> None:
        """Write what is held as a chunk."""
        if not self._size:
            return
        data = bytearray().join(self._pieces)
        offsets = np.concatenate(self._offsets)
        records = np.frombuffer(data, np.uint8)
        records[offsets + _CHANNEL] = self._number & 0xFF
        records[offsets + _CHANNEL + 1] = self._number >> 8
        times = np.concatenate(self._times).view(np.uint64)
        unsigned = offsets.astype(np.uint64)
        del records
        self._writer.write_chunk(
            self._number, data, times, unsigned, self._compression, standalone=False
        )
        self._pieces, self._offsets, self._times, self._size = [], [], [], 0
