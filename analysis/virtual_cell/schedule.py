"""What happens when: identification, return, travel of the robot, arc; times in s, lengths in mm.

The robot runs a straight line at constant speed, with a flying start before the arc and a dip of
speed if one is planted.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .seam import WELD_LENGTH_MM, TrueSeam

TICK_S = 0.02
"""Finest step of the cell: the loop runs each second one, the camera each fifth."""
RETURN_S = 4.0
DWELL_S = 1.5
RAMP_S = 0.6
RUN_IN_S = 1.4
RUN_OUT_S = 1.5

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SpeedDip:
    """A planted dip: speed x (1 - depth) at its middle, a raised cosine `width_s` long."""

    centre_s_mm: float = 120.0
    depth: float = 0.4
    width_s: float = 2.5


@dataclass(frozen=True, slots=True)
class Schedule:
    """Torch y and its speed at each tick of TICK_S, and the times that divide the run."""

    y_mm: Floats
    speed_mm_s: Floats
    arc_on_s: float
    arc_off_s: float
    dip_s: tuple[float, float] | None

    @property
    def ticks(self) -> int:
        """Number of ticks in the run."""
        return len(self.y_mm)

    def y_at(self, time_s: float) -> float:
        """Torch position along the robot's travel."""
        return float(np.interp(time_s, TICK_S * np.arange(self.ticks), self.y_mm))


def make_schedule(
    seam: TrueSeam, identification_s: float, speed_mm_s: float, dip: SpeedDip | None
) -> Schedule:
    """The run of one weld."""
    start_s = identification_s + RETURN_S + DWELL_S
    run_in_mm = RUN_IN_S * speed_mm_s
    limit_s = start_s + RAMP_S + 3.0 * (WELD_LENGTH_MM + run_in_mm) / speed_mm_s
    time_s: Floats = TICK_S * np.arange(round(limit_s / TICK_S), dtype=np.float64)
    speed: Floats = speed_mm_s * np.clip((time_s - start_s) / RAMP_S, 0.0, 1.0)
    dip_s = None
    if dip is not None:
        before_mm = run_in_mm + float(seam.y_at(dip.centre_s_mm))
        lost_s = 0.25 * dip.depth * dip.width_s
        middle_s = start_s + 0.5 * RAMP_S + before_mm / speed_mm_s + lost_s
        dip_s = (middle_s - 0.5 * dip.width_s, middle_s + 0.5 * dip.width_s)
        speed *= _dip(time_s, middle_s, dip)
    y = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * TICK_S)]) - run_in_mm
    arc_on_s, arc_off_s = np.interp([0.0, WELD_LENGTH_MM], y, time_s)
    return _ended(Schedule(y, speed, float(arc_on_s), float(arc_off_s), dip_s))


def _dip(time_s: Floats, middle_s: float, dip: SpeedDip) -> Floats:
    phase = np.clip((time_s - middle_s) / dip.width_s, -0.5, 0.5)
    return np.asarray(1.0 - 0.5 * dip.depth * (1.0 + np.cos(2.0 * np.pi * phase)))


def _ended(schedule: Schedule) -> Schedule:
    """Slow down to rest after the arc and cut the run there."""
    first = int(np.ceil(schedule.arc_off_s / TICK_S)) + 1
    count = first + round(RUN_OUT_S / TICK_S)
    time_s = TICK_S * np.arange(count)
    speed = schedule.speed_mm_s[:count].copy()
    speed[first:] *= np.clip(1.0 - (time_s[first:] - time_s[first]) / RAMP_S, 0.0, 1.0)
    y = schedule.y_mm[:count].copy()
    y[first:] = y[first - 1] + np.cumsum(speed[first:]) * TICK_S
    return replace(schedule, y_mm=y, speed_mm_s=speed)
