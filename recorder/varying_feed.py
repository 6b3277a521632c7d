"""The consumer's side of rings whose records vary in length, raw pictures among them."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from seamlog.mcap.records import Buffer

from .accounts import Account, ring_account
from .feeds import ChunkSink, Gaps, note_high_water
from .mcap_writer import CHUNK_BYTES, CHUNK_S
from .ring import (
    DISCARDED,
    HEAD,
    LOST,
    MESSAGE,
    RAW_FRAME,
    RECORD,
    RECORD_HEAD_BYTES,
    SKIP,
    TAIL,
    WRITTEN,
    Ring,
)

Encode: TypeAlias = Callable[[memoryview], bytes]


class _Batch:
    """Records of the next chunk; neighbours in the ring stay one piece and are not copied."""

    def __init__(self) -> None:
        self._pieces: list[Buffer] = []
        self._span = (0, 0)
        self._offsets: list[int] = []
        self._times_ns: list[int] = []
        self.size = 0

    def __len__(self) -> int:
        return len(self._offsets)

    def add(self, record: Buffer) -> None:
        """Take a record that is not in the ring."""
        self._pieces.append(record)
        self._span = (0, 0)
        self._count(record)

    def add_span(self, data: memoryview, start: int, end: int) -> None:
        """Take the record at `data[start:end]`."""
        if self._span[1] == start and self._pieces:
            self._span = (self._span[0], end)
            self._pieces[-1] = data[self._span[0] : end]
        else:
            self._span = (start, end)
            self._pieces.append(data[start:end])
        self._count(data[start:end])

    def _count(self, record: Buffer) -> None:
        self._offsets.append(self.size)
        self._times_ns.append(RECORD.unpack_from(record)[4])
        self.size += len(record)

    def chunk(self) -> tuple[Buffer, np.ndarray, np.ndarray]:
        """Data, log times and offsets."""
        data = self._pieces[0] if len(self._pieces) == 1 else b"".join(self._pieces)
        return data, np.array(self._times_ns, np.uint64), np.array(self._offsets, np.uint64)


class VaryingFeed:
    """Feed of a ring of whole records.

    `encode` makes a message record of a raw picture; `is_urgent` tells of a message that is to be
    on the disk at once, and sets `urgent`.
    """

    def __init__(
        self,
        channel_id: int,
        topic: str,
        producer: str,
        ring: Ring,
        file: ChunkSink,
        encode: Encode | None = None,
        is_urgent: Callable[[memoryview], bool] | None = None,
    ) -> None:
        self.channel_id = channel_id
        self.topic = topic
        self.ring = ring
        self.gaps = Gaps()
        self.urgent = False
        self._file = file
        self._producer = producer
        self._encode = encode
        self._is_urgent = is_urgent
        self._read = int(ring.words[TAIL])
        self._seen = int(ring.words[WRITTEN] + ring.words[LOST] + ring.words[DISCARDED])
        self._batch = _Batch()
        self._oldest_s = 0.0

    def pump(self, now_s: float, flush: bool) -> bool:
        """Write what is due; see `Feed`. One raw picture per call unless `flush`."""
        if self._batch.size >= CHUNK_BYTES:
            self._write()
        head = int(self.ring.words[HEAD])
        note_high_water(self.ring, (head - int(self.ring.words[TAIL])) / self.ring.capacity)
        while self._read < head:
            if not self._batch:
                self._oldest_s = now_s
            was_picture = self._take(head)
            if self._batch.size >= CHUNK_BYTES:
                self._write()
            if was_picture and not flush:
                break
        if self._batch and (flush or now_s - self._oldest_s >= CHUNK_S):
            self._write()
        return self._read < head

    def account(self) -> Account:
        """The counts so far; accepted is what was seen in the ring."""
        return ring_account(self.topic, self._producer, self.ring, self._seen)

    def _take(self, head: int) -> bool:
        """Take one record into the batch; True if it was a raw picture."""
        data, capacity = self.ring.data, self.ring.capacity
        start = self._read % capacity
        opcode = data[start]
        if opcode == SKIP:
            self._read += capacity - start
            return False
        length = int.from_bytes(data[start + 1 : start + RECORD_HEAD_BYTES], "little")
        end = start + RECORD_HEAD_BYTES + length
        if opcode not in (MESSAGE, RAW_FRAME) or end > capacity or end - start > head - self._read:
            self._give_up(head)
            return False
        self._read += end - start
        self._seen += 1
        if opcode == MESSAGE:
            self._batch.add_span(data, start, end)
            self.urgent |= self._is_urgent is not None and self._is_urgent(data[start:end])
            return False
        self._take_picture(data[start:end])
        return True

    def _take_picture(self, raw: memoryview) -> None:
        try:
            if self._encode is None:
                raise ValueError("this channel takes no pictures")
            record = self._encode(raw)
        except Exception as error:  # noqa: BLE001 - OpenCV raises what it likes; count and go on
            self.ring.keep_reason(f"a picture could not be encoded: {error}")
            self.ring.words[LOST] += 1
            return
        self._batch.add(record)

    def _give_up(self, head: int) -> None:
        """The ring was damaged by someone: what is left in it cannot be told apart."""
        lost = max(self.ring.accepted - self._seen, 1)
        self.ring.keep_reason("the ring was overwritten by other code of the loop")
        self.ring.words[LOST] += lost
        self._seen += lost
        self._read = head

    def _write(self) -> None:
        data, times, offsets = self._batch.chunk()
        compression = "" if self._encode else "zstd"
        if self._file.write_chunk(self.channel_id, data, times, offsets, compression):
            self.ring.words[WRITTEN] += len(self._batch)
        self.gaps.note(times)
        self.ring.words[TAIL] = self._read
        self._batch = _Batch()
