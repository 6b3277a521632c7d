"""Log time: nanoseconds since 1970 that never step back.

The wall clock is read once; from then on the monotonic clock counts. A later step of the wall
clock therefore cannot reorder a log; `step_ns` tells how far both have drifted apart.
"""

import time
from typing import Protocol

SIMULATED_EPOCH_NS = 1_767_225_600_000_000_000
"""2026-01-01T00:00:00Z, where the clock of a simulated source starts."""


class Clock(Protocol):
    """Gives log times."""

    def now_ns(self) -> int:
        """Nanoseconds since 1970, never less than before."""
        ...


class MonotonicClock:
    """Wall time at the start, monotonic time from then on."""

    def __init__(self) -> None:
        self.anchor_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Log time, nanoseconds since 1970."""
        return time.monotonic_ns() + self.anchor_ns

    def step_ns(self) -> int:
        """How far the wall clock has moved against log time since the start."""
        return time.time_ns() - self.now_ns()


class SimulatedClock:
    """A clock that only its source moves."""

    def __init__(self, start_ns: int = SIMULATED_EPOCH_NS) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Simulated log time, nanoseconds since 1970."""
        return self._now_ns

    def advance_to(self, time_ns: int) -> None:
        """Move to `time_ns`; going back is refused with `ValueError`."""
        if time_ns < self._now_ns:
            raise ValueError(f"simulated clock cannot go back from {self._now_ns} to {time_ns} ns")
        self._now_ns = time_ns
