"""Rows of the exact sampled regression: over a period with constant command and sign of speed

    a (v_k - v_k-1) + b (x_k - x_k-1) + C s T = u T

holds exactly, whatever the period T. Where the speed changes sign or is small the whole row is
zeroed. All columns then pass 1 / (1 - q z^-1), which turns the differenced speed noise back into
nearly white noise; q = 0 leaves the rows as they are.
"""

import math

from .gain import Vector


class GatedRows:
    """The newest row: `regressor` (m/s, m, s), `impulse` (command unit s), the filter's memory."""

    def __init__(self, gate_m_s: float, filter_pole: float, period_s: float) -> None:
        self._gate_m_s, self._pole, self._period_s = gate_m_s, filter_pole, period_s
        self._last: tuple[float, float] | None = None
        self.regressor: Vector = (0.0, 0.0, 0.0)
        self.impulse = 0.0
        self.memory_s = 0.0

    def push(self, position_m: float, velocity_m_s: float, command: float) -> bool:
        """Take a sample and the command before it; False if it made no usable row."""
        last, self._last = self._last, (position_m, velocity_m_s)
        if last is None:
            return False
        pole, period, w = self._pole, self._period_s, self.regressor
        before_m, before_m_s = last
        self.impulse *= pole
        self.memory_s *= pole
        low, high = min(before_m_s, velocity_m_s), max(before_m_s, velocity_m_s)
        whole = math.isfinite(before_m + before_m_s + position_m + velocity_m_s + command)
        if not (whole and (low > self._gate_m_s or high < -self._gate_m_s)):
            self.regressor = (pole * w[0], pole * w[1], pole * w[2])
            return False
        self.impulse += command * period
        self.memory_s += period
        self.regressor = (
            pole * w[0] + (velocity_m_s - before_m_s),
            pole * w[1] + (position_m - before_m),
            pole * w[2] + (period if low > 0.0 else -period),
        )
        return True

    def restart(self) -> None:
        """Empty the filter, as after a stretch at rest."""
        self.regressor, self.impulse, self.memory_s = (0.0, 0.0, 0.0), 0.0, 0.0

    def error(self, estimate: Vector) -> float:
        """Predicted - applied impulse of the newest row, command unit s."""
        w = self.regressor
        return w[0] * estimate[0] + w[1] * estimate[1] + w[2] * estimate[2] - self.impulse

    def mean_error(self, error: float) -> float:
        """`error` as a command, averaged over the filter's memory; NaN while that is empty."""
        return error / self.memory_s if self.memory_s > 1e-9 * self._period_s else math.nan
