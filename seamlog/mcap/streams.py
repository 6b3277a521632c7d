"""Message streams: payloads of one channel come one by one and leave as large chunks."""

from typing import TYPE_CHECKING

import numpy as np

from seamlog.channels import IMAGE_SCHEMA
from seamlog.mcap.compression import NONE
from seamlog.mcap.packing import payload_records

if TYPE_CHECKING:
    from seamlog.mcap.writer import FileWriter

_CHUNK_BYTES = 2 << 20


class MessageStream:
    """The messages of one channel on their way into a file; made by `BatchWriter.stream`."""

    def __init__(
        self, writer: "FileWriter", channel_id: int, schema: str, compression: str
    ) -> None:
        self._writer, self._channel_id = writer, channel_id
        self._compression = NONE if schema == IMAGE_SCHEMA else compression
        self._payloads: list[bytes] = []
        self._times: list[int] = []
        self._size = 0
        self.count = 0

    def put(self, log_time_ns: int, payload: bytes) -> None:
        """Take one message."""
        self._payloads.append(payload)
        self._times.append(log_time_ns)
        self._size += len(payload)
        if self._size >= _CHUNK_BYTES:
            self.flush()

    def flush(self) -> None:
        """Write what is held as a chunk."""
        if not self._payloads:
            return
        times = np.array(self._times, np.int64)
        part = slice(0, len(times))
        data, offsets = payload_records(self._payloads, times, part, self._channel_id, self.count)
        self._writer.write_chunk(
            self._channel_id, data, times.view(np.uint64), offsets, self._compression, False
        )
        self.count += len(times)
        self._payloads, self._times, self._size = [], [], 0
