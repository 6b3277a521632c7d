"""Turns the counter of a device into log time."""

from dataclasses import dataclass

_DRIFT = 1e-4
"""Crystals differ by less: so fast may a device's clock run against ours."""


@dataclass(slots=True)
class DeviceClock:
    """Device ticks to log time: the event was `least delay seen` before its arrival.

    Messages are never early, so the smallest difference between arrival and device time is the
    best known offset; it may grow slowly, as clocks drift. `wraps` is where the counter begins
    again, 0 if it does not.
    """

    tick_ns: float
    wraps: int = 0
    _last: int = -1
    _turns: int = 0
    _offset_ns: int = 0
    _arrival_ns: int = 0

    def stamp_ns(self, ticks: int, arrival_ns: int) -> int:
        """Log time of the event that happened at `ticks` and whose message came at `arrival_ns`."""
        if self.wraps and ticks < self._last:
            self._turns += 1
        began_anew = not self.wraps and ticks < self._last
        device_ns = round((ticks + self._turns * self.wraps) * self.tick_ns)
        offset = arrival_ns - device_ns
        if self._last < 0 or began_anew:
            self._offset_ns = offset
        else:
            slack = round((arrival_ns - self._arrival_ns) * _DRIFT)
            self._offset_ns = min(self._offset_ns + slack, offset)
        self._last, self._arrival_ns = ticks, arrival_ns
        return device_ns + self._offset_ns
