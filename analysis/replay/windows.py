"""The equation of motion over windows of positions: acceleration without the noisy speed.

Over a window from x[k-w] to x[k+w] with held commands,

    a (x[k+w] - 2 x[k] + x[k-w]) / (w T)^2 + b (x[k+w] - x[k-w]) / (2 w T) = mean force

where the mean weighs what acts by a triangle around k (exact for b = 0; for b > 0 the triangle
leans forward by b w T / (6 a) of its area, which `lean` does). An encoder of micrometres tells
acceleration this way far better than the speed it also sends.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord, FloatArray

from .shadow import applied_commands

_POINTS = 16
_SLOWEST_M_S = 3e-4


@dataclass(frozen=True)
class Windows:
    """One row per window in which the axis slides one way; `rows` are the middle samples.

    `force` is the command's weighted mean; positions and speeds within the window have shape
    (rows, points), to be averaged with `weights`.
    """

    rows: NDArray[np.int64]
    force: FloatArray
    acceleration_m_s2: FloatArray
    velocity_m_s: FloatArray
    positions_m: FloatArray
    speeds_m_s: FloatArray
    weights: FloatArray

    def mean(self, values: FloatArray) -> FloatArray:
        """Weighted mean of `values` (rows, points) over each window."""
        return np.asarray(values @ self.weights)


def motion_windows(record: AxisRecord, delay_periods: int, lag_1_s: float, half: int) -> Windows:
    """Windows of twice `half` periods of `record`; `lag_1_s` is b / a as far as it is known."""
    period_s, x = record.period_s, record.position_m
    span_s = half * period_s
    middle = np.arange(half, len(record) - half)
    before, now, after = x[middle - half], x[middle], x[middle + half]
    velocity = (after - before) / (2 * span_s)
    per_period = max(1, _POINTS // half)
    offsets = np.linspace(-half, half, 2 * half * per_period + 1)
    weights = _triangle(offsets / half, lag_1_s * span_s)
    sliding = _slides(x, half, middle, period_s)
    middle, velocity = middle[sliding], velocity[sliding]
    times = np.arange(len(record), dtype=np.float64)
    within = middle[:, None] + offsets
    speed = np.gradient(x, period_s)
    applied = applied_commands(record.command, delay_periods)
    held = applied[np.minimum(np.floor(within + 1e-9).astype(np.int64), len(record) - 1)]
    edge = offsets == np.round(offsets)
    ago = np.maximum(np.floor(within - 1e-9).astype(np.int64), 0)
    held[:, edge] = 0.5 * (held[:, edge] + applied[ago[:, edge]])
    return Windows(
        rows=middle,
        force=held @ weights,
        acceleration_m_s2=(after - 2 * now + before)[sliding] / span_s**2,
        velocity_m_s=velocity,
        positions_m=np.interp(within, times, x),
        speeds_m_s=np.interp(within, times, speed),
        weights=weights,
    )


def _triangle(place: FloatArray, lean: float) -> FloatArray:
    """Weights at `place` in [-1, 1] for the trapezoidal rule, sum 1."""
    weights = 1 - np.abs(place)
    weights = weights * (1 + np.sign(place) * lean / 6)
    return np.asarray(weights / weights.sum())


def _slides(
    x: FloatArray, half: int, middle: NDArray[np.int64], period_s: float
) -> NDArray[np.bool_]:
    """Whether all steps of a window and its neighbours go one way, none slower than the slowest."""
    step = np.diff(x) / period_s
    sums = [np.concatenate([[0], np.cumsum(s * step > _SLOWEST_M_S)]) for s in (1, -1)]
    first, last = np.maximum(middle - half - 1, 0), np.minimum(middle + half + 1, len(x) - 1)
    ways = [total[last] - total[first] == last - first for total in sums]
    return np.asarray(ways[0] | ways[1])
