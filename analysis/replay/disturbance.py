"""What acted on the axis beside the model: the slow part of what the model cannot explain.

Where the axis slides the sampled equation of motion gives it directly, window by window where
positions are fine enough, else period by period; it is interpolated where the axis stands or
turns, and passed through a zero-phase low pass, because its fast part is measurement noise.
"""

from dataclasses import dataclass

import numpy as np
from scipy import signal

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.analysis.friction import sliding_friction
from seamlog.contracts import Axis

from .model import RippleForce
from .sliding import sliding_force
from .windows import Windows

CUTOFF_HZ = 1.0
_BLOCK_S = 1.0


@dataclass(frozen=True)
class Residual:
    """`slow` is the disturbance taken as real, `fast` the rest; command unit, shape (n,)."""

    slow: FloatArray
    fast: FloatArray
    period_s: float

    def resampled(self, random: np.random.Generator) -> FloatArray:
        """The slow part as it might have come out with other noise (block bootstrap)."""
        count = len(self.fast)
        block = max(1, round(_BLOCK_S / self.period_s))
        starts = random.integers(0, max(1, count - block), size=-(-count // block))
        rows = (starts[:, None] + np.arange(block)).ravel()[:count]
        return self.slow + low_pass(self.fast[np.minimum(rows, count - 1)], self.period_s)


def window_residual(
    record: AxisRecord, windows: Windows, axis: Axis, ripple: RippleForce
) -> Residual:
    """Residual of the windows against `axis` and `ripple`, positive where it opposes."""
    angle = 2 * np.pi * windows.positions_m / ripple.pitch_m
    waves = ripple.sine * np.sin(angle) + ripple.cosine * np.cos(angle)
    excess = max(0.0, axis.static_friction - axis.coulomb_friction)
    level = np.full(windows.speeds_m_s.shape, axis.coulomb_friction)
    if excess and axis.stribeck_speed_m_s > 0:
        ratio = np.abs(windows.speeds_m_s) / axis.stribeck_speed_m_s
        level += excess * np.exp(-(ratio**axis.stribeck_power))
    unexplained = (
        windows.force
        - axis.inertia * windows.acceleration_m_s2
        - axis.viscous_friction * windows.velocity_m_s
        - axis.offset
        - np.sign(windows.velocity_m_s) * windows.mean(level)
        - windows.mean(waves)
    )
    raw = np.interp(np.arange(len(record)), windows.rows, unexplained)
    slow = low_pass(raw, record.period_s)
    return Residual(slow, raw - slow, record.period_s)


def residual_disturbance(record: AxisRecord, axis: Axis) -> Residual:
    """Residual of `record` against the model of `axis`, positive where it opposes the command."""
    period_s = record.period_s
    sliding = sliding_force(record, axis)
    speed = sliding.velocity_m_s
    friction = np.array([sliding_friction(axis, abs(value)) for value in speed.tolist()])
    unexplained = sliding.force - np.sign(speed) * friction
    rows = np.flatnonzero(sliding.rows)
    if not len(rows):
        nothing = np.zeros(len(record))
        return Residual(nothing, nothing, period_s)
    raw = np.interp(np.arange(len(record)), rows, unexplained[rows])
    slow = low_pass(raw, period_s)
    return Residual(slow, raw - slow, period_s)


def low_pass(values: FloatArray, period_s: float) -> FloatArray:
    """Second-order Butterworth at CUTOFF_HZ, zero phase; values at too low a rate stay."""
    cutoff = 2 * CUTOFF_HZ * period_s
    if cutoff >= 1:
        return values
    b, a = signal.butter(2, cutoff)
    padding = min(3 * max(len(a), len(b)), len(values) - 1)
    return np.asarray(signal.filtfilt(b, a, values, padlen=padding), dtype=np.float64)
