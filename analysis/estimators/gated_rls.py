"""The default estimator: exact sampled regression, gated near rest, recursive least squares.

The rows (see `rows`) feed recursive least squares with exponential forgetting and bounded gain
(eq. 22, 23 in inverse form, stable for every initial gain).
"""

import math

from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.deterministic import exponential

from .gain import Vector, diagonal_gain, largest_eigenvalue, reduced, times
from .innovations import Innovations
from .rows import GatedRows


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
        self._rows = GatedRows(config.gate_m_s, config.filter_pole, period_s)
        self._innovations = Innovations()

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        """Take one sample and the command that acted over the period before it.

        Returns the error of the prediction (predicted - applied, command unit), averaged over
        the filter's memory; NaN while there is no usable row.
        """
        usable = self._rows.push(position_m, velocity_m_s, applied_command)
        error = self._rows.error(self._estimate)
        if usable:
            self._learn(error)
        else:
            self._innovations.end_block()
        return self._rows.mean_error(error)

    def _learn(self, error: float) -> None:
        period = self._period_s
        w, p = self._rows.regressor, self._estimate
        kept = exponential(-period * self._forgetting())
        step = times(self._gain, w)
        information = w[0] * step[0] + w[1] * step[1] + w[2] * step[2]
        weight = period / (kept + period * information)
        move = weight * error
        self._estimate = (p[0] - move * step[0], p[1] - move * step[1], p[2] - move * step[2])
        self._gain = reduced(self._gain, step, weight, 1.0 / kept)
        white = error * math.sqrt(weight * kept / period)
        self._innovations.add(w, period * white, kept)

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
        """From the gain and the prediction errors so far; NaN before four stretches of sliding."""
        return self._innovations.variances(self._gain)
