"""Textbook recursive least squares with exponential forgetting: the baseline.

On the bare sampled rows, not filtered, with a sign of speed that flips at zero: the noise of the
differenced speed enters the regressor and pulls the inertia down, and nothing bounds the gain
while the axis rests. `gated_rls` mends both.
"""

import math

from pydantic import BaseModel, ConfigDict, Field

from .gain import Vector, diagonal_gain, reduced, times
from .innovations import Innovations
from .rows import GatedRows


class RLSConfig(BaseModel):
    """Tuning; gains refer to regressors in m/s, m and s, whatever the unit of the command."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    forgetting_factor: float = Field(0.9998, gt=0, le=1)
    """Weight of a row against the next one."""
    initial_gain: float = Field(1e8, gt=0)


class RLS:
    """Recursive estimate of inertia, viscous and Coulomb friction with covariance."""

    Config = RLSConfig

    def __init__(self, config: RLSConfig, period_s: float) -> None:
        self._kept, self._period_s = config.forgetting_factor, period_s
        self._gain = diagonal_gain((config.initial_gain,) * 3)
        self._estimate: Vector = (0.0, 0.0, 0.0)
        self._rows = GatedRows(0.0, 0.0, period_s)
        self._innovations = Innovations()

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        """Take one sample and the command that acted over the period before it.

        Returns predicted - applied command; NaN where the speed changed sign.
        """
        if not self._rows.push(position_m, velocity_m_s, applied_command):
            self._innovations.end_block()
            return math.nan
        w, p = self._rows.regressor, self._estimate
        error = self._rows.error(p)
        step = times(self._gain, w)
        spread = self._kept + w[0] * step[0] + w[1] * step[1] + w[2] * step[2]
        move = error / spread
        self._estimate = (p[0] - move * step[0], p[1] - move * step[1], p[2] - move * step[2])
        self._gain = reduced(self._gain, step, 1.0 / spread, 1.0 / self._kept)
        self._innovations.add(w, error * math.sqrt(self._kept / spread), self._kept)
        return error / self._period_s

    def parameters(self) -> tuple[float, float, float]:
        """inertia, viscous friction, Coulomb friction."""
        return self._estimate

    def variances(self) -> tuple[float, float, float]:
        """From the gain and the prediction errors so far; NaN before four stretches of sliding."""
        return self._innovations.variances(self._gain)
