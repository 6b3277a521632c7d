"""Force beside inertia and viscous friction, period by period, where the axis surely slides.

Sliding is judged by travel per period, not by the logged speed: the encoder's step is far finer
than the noise of the speed, so that motion of less than a millimetre per second still counts.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.contracts import Axis

from .shadow import applied_commands

SLOWEST_M_S = 5e-4
_STEPS = 5


@dataclass(frozen=True)
class Sliding:
    """One row per control period k -> k + 1, shape (n - 1,); `force` in the command's unit.

    `force` is what remains of the command: dry friction and disturbance.
    """

    velocity_m_s: FloatArray
    force: FloatArray
    rows: NDArray[np.bool_]


def sliding_force(record: AxisRecord, axis: Axis) -> Sliding:
    """Take inertia, viscous friction and offset of `axis` off the commands of `record`."""
    period_s = record.period_s
    velocity = np.diff(record.position_m) / period_s
    applied = applied_commands(record.command, axis.delay_periods)[:-1]
    force = (
        applied
        - axis.inertia * np.diff(record.velocity_m_s) / period_s
        - axis.viscous_friction * velocity
        - axis.offset
    )
    slowest = max(SLOWEST_M_S, _STEPS * position_step_m(record) / period_s)
    fast = np.abs(velocity) > slowest
    same = velocity[1:] * velocity[:-1] > 0
    none = np.zeros(1, dtype=np.bool_)
    rows = fast & np.concatenate([none, same]) & np.concatenate([same, none])
    return Sliding(velocity, force, rows)


def position_step_m(record: AxisRecord) -> float:
    """Smallest change of position: the step of the encoder; 0 if it never moves."""
    steps = np.abs(np.diff(record.position_m))
    steps = steps[steps > 1e-12]
    return float(steps.min()) if len(steps) else 0.0
