"""The consumer's side of the rings: from accepted messages to chunks of the session file.

The tail of a ring moves only when its messages are in the file: if the recorder process dies,
all that it had not written is still in the ring.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap.records import Buffer

from .accounts import Account, ring_account
from .mcap_writer import CHUNK_BYTES, CHUNK_S
from .ring import (
    HEAD,
    HIGH_WATER_PPM,
    LOST,
    TAIL,
    WRITTEN,
    Ring,
)

_LOG_TIME = slice(15, 23)
_FRONT = slice(0, 11)


class Gaps:
    """Watches log times for the longest gap between two messages."""

    def __init__(self) -> None:
        self.newest_ns: int | None = None
        self._longest_ns = -1

    def note(self, times_ns: NDArray[np.uint64]) -> None:
        """Take in the log times of a chunk, in order."""
        signed = times_ns.astype(np.int64)
        if self.newest_ns is not None:
            signed = np.concatenate(([self.newest_ns], signed))
        if len(signed) > 1:
            self._longest_ns = max(self._longest_ns, int(np.diff(signed).max()))
        self.newest_ns = int(signed[-1])

    @property
    def longest_s(self) -> float | None:
        """The longest so far, None before the second message."""
        return self._longest_ns / 1e9 if self._longest_ns >= 0 else None


def note_high_water(ring: Ring, filled: float) -> None:
    """Keep the largest filled fraction of a ring."""
    parts = round(filled * 1_000_000)
    if parts > ring.words[HIGH_WATER_PPM]:
        ring.words[HIGH_WATER_PPM] = parts


class ChunkSink(Protocol):
    """Where the chunks go: the session being recorded, or one being recovered."""

    def write_chunk(
        self,
        channel_id: int,
        data: Buffer,
        log_times_ns: NDArray[np.uint64],
        offsets: NDArray[np.uint64],
        compression: str,
    ) -> bool:
        """Write whole records as a chunk that stands alone; after an `OSError` it is not there.

        False if the chunk is kept for later, and counted then.
        """
        ...


class Feed(Protocol):
    """Takes messages out of one ring and writes them."""

    channel_id: int
    topic: str
    ring: Ring
    gaps: Gaps

    def pump(self, now_s: float, flush: bool) -> bool:
        """Write what is due at monotonic time `now_s`, with `flush` all that is there.

        True if there is more to do at once. After an `OSError` nothing is lost and nothing is
        written twice: call again.
        """
        ...

    def account(self) -> Account:
        """The counts so far."""
        ...


class FixedFeed:
    """Feed of a ring of fixed stride: a chunk is a stretch of the ring as it stands."""

    def __init__(
        self, channel_id: int, topic: str, producer: str, ring: Ring, file: ChunkSink
    ) -> None:
        self.channel_id = channel_id
        self.topic = topic
        self.ring = ring
        self.gaps = Gaps()
        self._file = file
        self._producer = producer
        self._rows = np.frombuffer(ring.data, np.uint8).reshape(-1, ring.stride)
        self._front = self._rows[0, _FRONT].copy()
        self._most = max(1, CHUNK_BYTES // ring.stride)
        self._oldest_s: float | None = None

    def pump(self, now_s: float, flush: bool) -> bool:
        """Write what is due; see `Feed`."""
        head, tail = int(self.ring.words[HEAD]), int(self.ring.words[TAIL])
        note_high_water(self.ring, (head - tail) / self.ring.slots)
        if self._oldest_s is None and head > tail:
            self._oldest_s = now_s
        due = flush or (self._oldest_s is not None and now_s - self._oldest_s >= CHUNK_S)
        while head - tail >= self._most or (due and head > tail):
            tail = self._write(tail, min(head - tail, self._most))
            self._oldest_s = now_s if head > tail else None
        return False

    def account(self) -> Account:
        """The counts so far."""
        return ring_account(self.topic, self._producer, self.ring, self.ring.accepted)

    def _write(self, tail: int, count: int) -> int:
        first = tail % self.ring.slots
        count = min(count, self.ring.slots - first)
        rows = self._rows[first : first + count]
        whole = (rows[:, _FRONT] == self._front).all(axis=1)
        lost = count - int(whole.sum())
        if lost:
            rows = rows[whole]
        is_written = self._write_rows(rows)
        words = self.ring.words
        words[WRITTEN] += count - lost if is_written else 0
        words[LOST] += lost
        words[TAIL] = tail + count
        return tail + count

    def _write_rows(self, rows: NDArray[np.uint8]) -> bool:
        if not len(rows):
            return False
        times = rows[:, _LOG_TIME].copy().view("<u8").ravel()
        offsets = np.arange(len(rows), dtype=np.uint64) * self.ring.stride
        data = np.ascontiguousarray(rows).data.cast("B")
        is_written = self._file.write_chunk(self.channel_id, data, times, offsets, "zstd")
        self.gaps.note(times)
        return is_written
