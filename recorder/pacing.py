"""A sink that keeps a simulated source to the pace of real time, or ends it."""

import time
from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from seamlog.contracts import ChannelWriter, Sink


class DurationOver(Exception):
    """The time asked for is over; ends the source from within."""


class Pacer:
    """Looks at stamps: sleeps until real time has come so far, and raises `DurationOver`."""

    def __init__(self, sink: Sink, realtime: bool, duration_s: float | None) -> None:
        self._sink = sink
        self._realtime = realtime
        self._duration_s = duration_s
        self._first_ns: int | None = None
        self._start_s = 0.0

    def channel(self, topic: str, metadata: Mapping[str, str] | None = None) -> ChannelWriter:
        """The channel of `topic`, at this pace."""
        return _PacedChannel(self._sink.channel(topic, metadata), self)

    def log_frame(self, topic: str, image: NDArray[Any], stamp_ns: int | None = None) -> bool:
        """Log a picture at this pace."""
        if stamp_ns is not None:
            self.keep_to(stamp_ns)
        return self._sink.log_frame(topic, image, stamp_ns)

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Put a file into the session."""
        self._sink.attach(name, data, media_type)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Put a metadata record into the session."""
        self._sink.add_metadata(name, values)

    def keep_to(self, stamp_ns: int) -> None:
        """Sleep until it is time for `stamp_ns`."""
        if self._first_ns is None:
            self._first_ns, self._start_s = stamp_ns, time.monotonic()
        elapsed_s = (stamp_ns - self._first_ns) / 1e9
        if self._duration_s is not None and elapsed_s >= self._duration_s:
            raise DurationOver
        ahead_s = self._start_s + elapsed_s - time.monotonic()
        if self._realtime and ahead_s > 0:
            time.sleep(ahead_s)


class _PacedChannel:
    def __init__(self, channel: ChannelWriter, pacer: Pacer) -> None:
        self._channel = channel
        self._pacer = pacer

    def put(self, stamp_ns: int, *values: Any) -> bool:
        """Log one message when its time has come."""
        self._pacer.keep_to(stamp_ns)
        return self._channel.put(stamp_ns, *values)
