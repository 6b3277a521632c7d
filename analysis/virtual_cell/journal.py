"""Messages on their way to the recorder: each is logged when it arrives, not when it happened."""

import heapq
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from seamlog.contracts import ChannelWriter, Sink

from .truth import stamp_ns


class MovedClock(Protocol):
    """A clock that the source moves: the simulated one, or one that waits for the wall clock."""

    def now_ns(self) -> int:
        """Log time."""
        ...

    def advance_to(self, time_ns: int) -> None:
        """Move to `time_ns`."""
        ...


class Journal:
    """Holds messages until their arrival and logs them in that order."""

    def __init__(
        self, sink: Sink, clock: MovedClock, metadata: Mapping[str, Mapping[str, str]]
    ) -> None:
        self._sink, self._clock, self._metadata = sink, clock, metadata
        self._channels: dict[str, ChannelWriter] = {}
        self._waiting: list[tuple[int, int, Callable[[], object]]] = []
        self._count = 0

    def put(self, topic: str, happened_s: float, arrives_s: float, *values: Any) -> None:
        """A message of `topic`, stamped with the event, logged at its arrival."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._sink.channel(topic, self._metadata.get(topic))
            self._channels[topic] = channel
        writer = channel
        self._wait(arrives_s, lambda: writer.put(stamp_ns(happened_s), *values))

    def picture(self, happened_s: float, arrives_s: float, image: NDArray[np.uint8]) -> None:
        """A picture of the webcam."""
        stamp = stamp_ns(happened_s)
        self._wait(arrives_s, lambda: self._sink.log_frame("/camera/image", image, stamp))

    def _wait(self, arrives_s: float, log: Callable[[], object]) -> None:
        self._count += 1
        heapq.heappush(self._waiting, (stamp_ns(arrives_s), self._count, log))

    def flush(self, until_s: float) -> None:
        """Log what has arrived by `until_s`."""
        until_ns = stamp_ns(until_s)
        while self._waiting and self._waiting[0][0] <= until_ns:
            arrived_ns, _, log = heapq.heappop(self._waiting)
            self._clock.advance_to(arrived_ns)
            log()
