"""Snapshot mode: the last seconds wait in memory until something is worth writing.

Chunks are kept as the feeds made them, log times in order; their messages count as written when
they are in the file, as discarded when they grow too old. Times are log times.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import EVENT_KINDS
from seamlog.mcap.records import Buffer
from seamlog.messages import CDR_HEADER

from .mcap_writer import SessionFile
from .ring import DISCARDED, RECORD, WRITTEN, Ring
from .storage import Snapshot
from .trigger_rule import RuleWatch, parse_rule

KIND_AT = RECORD.size + len(CDR_HEADER) + 8
"""Offset of `kind` in a message record of `/events`: behind the payload's stamp."""
_STRAGGLE_NS = 500_000_000
"""Chunks of other channels may come so much later."""


@dataclass(frozen=True, slots=True, eq=False)
class _Chunk:
    ring: Ring
    channel_id: int
    data: bytes
    log_times_ns: NDArray[np.uint64]
    offsets: NDArray[np.uint64]
    compression: str

    @property
    def start_ns(self) -> int:
        return int(self.log_times_ns[0])

    @property
    def end_ns(self) -> int:
        return int(self.log_times_ns[-1])

    def part(self, first: int, last: int) -> "_Chunk":
        """Messages `first` up to and without `last`."""
        begin = int(self.offsets[first]) if first < len(self.offsets) else len(self.data)
        end = int(self.offsets[last]) if last < len(self.offsets) else len(self.data)
        offsets = self.offsets[first:last] - np.uint64(begin)
        times = self.log_times_ns[first:last]
        return replace(self, data=self.data[begin:end], log_times_ns=times, offsets=offsets)


class SnapshotBuffer:
    """Holds chunks back, and lets those around a trigger through.

    `tell` is called with the reason of each trigger that begins a snapshot and its log time.
    """

    def __init__(
        self, config: Snapshot, file: SessionFile, tell: Callable[[str, int], None]
    ) -> None:
        self._before_ns = round(config.before_s * 1e9)
        self._after_ns = round(config.after_s * 1e9)
        self._most_bytes = config.memory_bytes
        self._kinds = {EVENT_KINDS[name]: name for name in config.events}
        self._watches = [RuleWatch(parse_rule(text)) for text in config.rules]
        self._file = file
        self._tell = tell
        self._held: deque[_Chunk] = deque()
        self._bytes = 0
        self._newest_ns = 0
        self._from_ns, self._until_ns = 0, -1
        self.is_short = False
        """Memory was too small to keep all of the time before a trigger."""

    @property
    def is_open(self) -> bool:
        """A snapshot is being written."""
        return self._until_ns >= 0

    def sink(self, topic: str, ring: Ring) -> "HeldSink":
        """Where the feed of `ring` puts its chunks."""
        return HeldSink(topic, ring, self)

    def see_event(self, record: memoryview) -> bool:
        """Look at a message of `/events`; True if it triggers."""
        kind = self._kinds.get(record[KIND_AT])
        if kind is not None:
            self.trigger(f"event {kind}", int(RECORD.unpack_from(record)[4]))
        return kind is not None

    def trigger(self, reason: str, time_ns: int) -> None:
        """Begin a snapshot around `time_ns`, or make the running one longer."""
        is_new = not self.is_open
        if is_new:
            self._from_ns = max(time_ns - self._before_ns, 0)
        self._until_ns = max(self._until_ns, time_ns + self._after_ns)
        if is_new:
            self._tell(reason, time_ns)

    def hold(self, topic: str, chunk: _Chunk) -> None:
        """Take a chunk; rules are applied to it."""
        self._held.append(chunk)
        self._bytes += len(chunk.data)
        self._newest_ns = max(self._newest_ns, chunk.end_ns)
        for watch in self._watches:
            if topic in watch.rule.topics:
                rows = np.frombuffer(chunk.data, np.uint8).reshape(len(chunk.offsets), -1)
                for time_ns in watch.span(topic, rows) or ():
                    self.trigger(watch.rule.text, time_ns)

    def step(self) -> None:
        """Write what belongs to a snapshot, forget what is too old; after an `OSError` again."""
        if self.is_open:
            for chunk in [row for row in self._held if row.start_ns <= self._until_ns]:
                self._let_through(chunk)
            if self._newest_ns > self._until_ns + _STRAGGLE_NS:
                self._until_ns = -1
        while self._held and self._is_old(self._held[0]):
            chunk = self._held.popleft()
            chunk.ring.words[DISCARDED] += len(chunk.offsets)
            self._bytes -= len(chunk.data)

    def end(self) -> None:
        """Discard what is held."""
        for chunk in self._held:
            chunk.ring.words[DISCARDED] += len(chunk.offsets)
        self._held.clear()

    def _is_old(self, chunk: _Chunk) -> bool:
        if self._bytes > self._most_bytes:
            self.is_short = True
            return True
        return chunk.end_ns < self._newest_ns - self._before_ns

    def _let_through(self, chunk: _Chunk) -> None:
        """Write what of a chunk belongs to the snapshot; the older goes, the newer stays."""
        first, last = np.searchsorted(
            chunk.log_times_ns, np.array([self._from_ns, self._until_ns + 1], np.uint64)
        ).tolist()
        if first < last:
            self._write(chunk.part(first, last))
        chunk.ring.words[DISCARDED] += first
        place = self._held.index(chunk)
        rest = chunk.part(last, len(chunk.offsets))
        self._held[place] = rest
        if not len(rest.offsets):
            del self._held[place]
        self._bytes -= len(chunk.data) - len(rest.data)

    def _write(self, chunk: _Chunk) -> None:
        self._file.write_chunk(
            chunk.channel_id, chunk.data, chunk.log_times_ns, chunk.offsets, chunk.compression
        )
        chunk.ring.words[WRITTEN] += len(chunk.offsets)


class HeldSink:
    """The place of the session file for one feed in snapshot mode."""

    def __init__(self, topic: str, ring: Ring, buffer: SnapshotBuffer) -> None:
        self._topic = topic
        self._ring = ring
        self._buffer = buffer

    def write_chunk(
        self,
        channel_id: int,
        data: Buffer,
        log_times_ns: NDArray[np.uint64],
        offsets: NDArray[np.uint64],
        compression: str,
    ) -> bool:
        """Hold the chunk; False: it is not in the file yet."""
        chunk = _Chunk(self._ring, channel_id, bytes(data), log_times_ns, offsets, compression)
        self._buffer.hold(self._topic, chunk)
        return False
