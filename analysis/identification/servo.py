"""The drive's own law, told by the record: a cascade of position and speed loop.

    u_k = k_v (k_p (r_k - x_k) - (x_k - x_k-w) / (w T))

Gains, window w and delay come from a least-squares fit of the recorded commands to the recorded
reference and position; what is left is the floor under any replay of this controller.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

from .friction_models import FloatArray

WINDOWS = (1, 2, 3, 4)
DELAYS = (-2, -1, 0, 1, 2)
LARGEST_ERROR = 0.05
"""Relative rms of the commands above which the law is not taken for the drive's."""


@dataclass(frozen=True)
class Servo:
    """position_gain_1_s k_p, velocity_gain k_v (command unit s/m), window w, relative error.

    `delay_periods`: how much later than the positions the command was computed (0 expected).
    """

    position_gain_1_s: float
    velocity_gain: float
    window: int
    delay_periods: int
    relative_error: float
    limit: float = float("inf")

    def commands(self, record: AxisRecord) -> FloatArray:
        """The law recomputed on recorded reference and position; NaN where it has no past."""
        error, speed = _errors(record, self.window)
        wanted = self.velocity_gain * (self.position_gain_1_s * error - speed)
        return _later(np.clip(wanted, -self.limit, self.limit), self.delay_periods)


def fit_servo(record: AxisRecord) -> Servo:
    """The law that explains the commands best; `EvidenceError` if none explains them."""
    if not record.has_reference:
        raise EvidenceError(
            "the session has no /table/reference: the drive's law cannot be told, so the loop "
            "cannot be simulated; record the reference, or use --method idim-ls"
        )
    best = min(_tried(record), key=lambda servo: servo.relative_error)
    if not best.relative_error < LARGEST_ERROR:
        raise EvidenceError(
            "the commands do not follow from reference and position by a position loop over a "
            f"speed loop (best fit leaves {100 * best.relative_error:.3g} % of them): the loop "
            "cannot be simulated; use --method idim-ls"
        )
    return best


def replay_error(record: AxisRecord, servo: Servo) -> float:
    """Rms of recomputed - recorded commands over that of the recorded ones."""
    difference = servo.commands(record) - record.command
    known = np.isfinite(difference) & ~record.saturated
    return float(np.linalg.norm(difference[known]) / np.linalg.norm(record.command[known]))


def _tried(record: AxisRecord) -> Iterator[Servo]:
    limited = np.abs(record.command[record.saturated])
    limit = float(limited.max()) if len(limited) else float("inf")
    for window in WINDOWS:
        error, speed = _errors(record, window)
        for delay in DELAYS:
            columns = np.column_stack([_later(error, delay), -_later(speed, delay)])
            known = np.isfinite(columns).all(axis=1) & np.isfinite(record.command)
            known &= ~record.saturated
            if int(known.sum()) < 100:
                continue
            wanted = record.command[known]
            values = np.linalg.lstsq(columns[known], wanted, rcond=None)[0]
            left = float(np.linalg.norm(wanted - columns[known] @ values) / np.linalg.norm(wanted))
            if values[1] > 0:
                position_gain = float(values[0] / values[1])
                yield Servo(position_gain, float(values[1]), window, delay, left, limit)
    yield Servo(0.0, 0.0, 1, 0, float("inf"))


def _errors(record: AxisRecord, window: int) -> tuple[FloatArray, FloatArray]:
    speed = np.full(len(record), np.nan)
    travel = record.position_m[window:] - record.position_m[:-window]
    speed[window:] = travel / (window * record.period_s)
    return record.error_m, speed


def _later(values: FloatArray, delay: int) -> FloatArray:
    shifted = np.full(len(values), np.nan)
    if delay >= 0:
        shifted[delay:] = values[: len(values) - delay]
    else:
        shifted[:delay] = values[-delay:]
    return shifted
