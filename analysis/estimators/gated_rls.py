"""The default estimator: exact sampled regression, gated near rest, recursive least squares.

Over a period with constant command u and constant sign s of the speed,

    a (v_k - v_k-1) + b (x_k - x_k-1) + C s T = u T

holds exactly, whatever the period T. Where the speed changes sign or is small the whole row is
zeroed. All columns then pass 1 / (1 - q z^-1), which turns the differenced speed noise back into
nearly white noise, and feed recursive least squares with exponential forgetting and bounded gain
(eq. 22, 23 in inverse form, stable for every initial gain).
"""

import math

from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.deterministic import exponential

from .gain import Vector, diagonal_gain, largest_eigenvalue, reduced, times


class GatedRLSConfig(BaseModel):
    """Tuning; gains refer to regressors in m/s, m and s, whatever the unit of the command."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    gate_m_s: float = Field(0.005, ge=0)
    """Rows with a slower end are left out."""
    filter_pole: float = Field(0.97, ge=0, lt=1)
    forgetting_rate: float = Field(0.005, ge=0)
    """lambda_0, 1/s."""
    initial_gain: float = Field(1e8, gt=0)
    gain_bound: float = Field(1e9, gt=0)
    """K_0: forgetting stops where the gain reaches it."""
    initial_inertia: float = 0.0
    initial_viscous_friction: float = 0.0
    initial_coulomb_friction: float = 0.0


class GatedRLS:
    """Recursive estimate of inertia, viscous and Coulomb friction with covariance."""

    Config = GatedRLSConfig

    def __init__(self, config: GatedRLSConfig, period_s: float) -> None:
        self._config, self._period_s = config, period_s
        self._gain = diagonal_gain((config.initial_gain,) * 3)
        self._estimate: Vector = (
            config.initial_inertia,
            config.initial_viscous_friction,
            config.initial_coulomb_friction,
        )
        self._last: tuple[float, float] | None = None
        self._regressor: Vector = (0.0, 0.0, 0.0)
        self._impulse = 0.0
        self._memory_s = 0.0
        self._rows = 0
        self._squares = self._products = self._last_error = 0.0

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        """Take one sample and the command that acted over the period before it.

        Returns the error of the prediction (predicted - applied, command unit), averaged over
        the filter's memory; NaN while there is no usable row.
        """
        last, self._last = self._last, (position_m, velocity_m_s)
        if last is None:
            return math.nan
        usable = self._filter(last, position_m, velocity_m_s, applied_command)
        w, p = self._regressor, self._estimate
        error = w[0] * p[0] + w[1] * p[1] + w[2] * p[2] - self._impulse
        if usable:
            self._learn(error)
        return error / self._memory_s if self._memory_s > 1e-9 * self._period_s else math.nan

    def _filter(
        self, last: tuple[float, float], position_m: float, velocity_m_s: float, command: float
    ) -> bool:
        pole, gate, period = self._config.filter_pole, self._config.gate_m_s, self._period_s
        before_m, before_m_s = last
        w = self._regressor
        self._impulse *= pole
        self._memory_s *= pole
        low, high = min(before_m_s, velocity_m_s), max(before_m_s, velocity_m_s)
        if not (low > gate or high < -gate):
            self._regressor = (pole * w[0], pole * w[1], pole * w[2])
            return False
        self._impulse += command * period
        self._memory_s += period
        self._regressor = (
            pole * w[0] + (velocity_m_s - before_m_s),
            pole * w[1] + (position_m - before_m),
            pole * w[2] + (period if low > 0.0 else -period),
        )
        return True

    def _learn(self, error: float) -> None:
        period = self._period_s
        w, p = self._regressor, self._estimate
        kept = exponential(-period * self._forgetting())
        step = times(self._gain, w)
        information = w[0] * step[0] + w[1] * step[1] + w[2] * step[2]
        weight = period / (kept + period * information)
        move = weight * error
        self._estimate = (p[0] - move * step[0], p[1] - move * step[1], p[2] - move * step[2])
        self._gain = reduced(self._gain, step, weight, 1.0 / kept)
        if self._rows >= 3:
            white = error * math.sqrt(weight * kept / period)
            self._squares += white * white
            self._products += white * self._last_error
            self._last_error = white
        self._rows += 1

    def _forgetting(self) -> float:
        """Eq. 23 with the 2-norm: lambda_0 (1 - |gain| / K_0), never below 0."""
        config = self._config
        if config.forgetting_rate == 0.0:
            return 0.0
        share = largest_eigenvalue(self._gain) / config.gain_bound
        return max(0.0, config.forgetting_rate * (1.0 - share))

    def parameters(self) -> tuple[float, float, float]:
        """inertia, viscous friction, Coulomb friction."""
        return self._estimate

    def variances(self) -> tuple[float, float, float]:
        """From the gain and the prediction errors so far; NaN before ten usable rows.

        Each gap at rest leaves an error that fades with the filter, so neighbouring prediction
        errors resemble each other; the variance grows by (1 + rho) / (1 - rho) for that.
        """
        if self._rows < 10:
            return math.nan, math.nan, math.nan
        alike = min(max(self._products / self._squares, 0.0), 0.99) if self._squares > 0 else 0.0
        noise = self._squares / (self._rows - 3) * self._period_s * (1.0 + alike) / (1.0 - alike)
        gain = self._gain
        return noise * gain[0], noise * gain[3], noise * gain[5]
