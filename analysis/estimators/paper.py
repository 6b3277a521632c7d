"""The paper's estimator: filtered regression (eq. 18-20), explicit Euler update (eq. 21-23).

Stable only while period x W Gamma W^T < 1, which is why the paper needs small gains; at 40 ms
it stays biased (docs/paper.md). Kept for comparison; `gated_rls` is the default.
"""

import math
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from seamlog.analysis.friction import arctangent_sign, friction_shape

from .gain import Gain, Vector, diagonal_gain, largest_eigenvalue, reduced, times


class PaperEstimatorConfig(BaseModel):
    """Tuning; `form` as_printed takes eq. 17 and 20 literally and needs the unit of speed."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    form: Literal["right", "as_printed"] = "right"
    speed_unit: Literal["m/s", "mm/s"] | None = None
    """Unit of the speed inside arctan(1e6 v) of eq. 17; for as_printed, and required there."""
    gain_form: Literal["full", "diag"] = "full"
    dead_zone_m_s: float = Field(0.007, gt=0)
    """alpha of the friction shape (eq. 3) in the regressor of the right form."""
    filter_pole: float = Field(0.97, ge=0, lt=1)
    """Of eq. 24; lambda_f = (1 - pole) / period."""
    forgetting_rate: float = Field(0.05, ge=0)
    initial_gain: float = Field(5.0, gt=0)
    gain_bound: float = Field(10.0, gt=0)
    settle_s: float = Field(3.0, ge=0)
    """The filters start empty; updates begin after this time."""
    initial_inertia: float = 0.0
    initial_viscous_friction: float = 0.0
    initial_coulomb_friction: float = 0.0

    @model_validator(mode="after")
    def _unit_known(self) -> "PaperEstimatorConfig":
        if self.form == "as_printed" and self.speed_unit is None:
            raise ValueError(
                "speed_unit is needed with form as_printed: arctan(1e6 v) depends on the unit"
            )
        return self


class PaperEstimator:
    """Inertia, viscous and Coulomb friction as the paper estimates them, without covariance."""

    Config = PaperEstimatorConfig

    def __init__(self, config: PaperEstimatorConfig, period_s: float) -> None:
        self._config, self._period_s = config, period_s
        right = config.form == "right"
        self._cutoff = (1.0 - config.filter_pole) / period_s if right else 1.0
        self._gain = diagonal_gain((config.initial_gain,) * 3)
        self._estimate: Vector = (
            config.initial_inertia,
            config.initial_viscous_friction,
            config.initial_coulomb_friction,
        )
        self._filtered = (0.0, 0.0, 0.0)
        self._started = False
        self._wait_periods = round(config.settle_s / period_s)

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        """Take one sample and the command that acted over the period before it.

        Returns e_p (eq. 16) scaled from the filter's output back to the command unit; the
        position is not used. NaN at the first sample, which only starts the filters.
        """
        del position_m
        if not self._started:
            self._start(velocity_m_s)
            return math.nan
        w = self._regressor(velocity_m_s, applied_command)
        p = self._estimate
        error = w[0] * p[0] + w[1] * p[1] + w[2] * p[2] - self._filtered[0]
        if self._wait_periods > 0:
            self._wait_periods -= 1
        else:
            self._learn(w, error)
        return error * (1.0 - self._config.filter_pole) / self._period_s

    def _start(self, velocity_m_s: float) -> None:
        self._started = True
        cutoff = (1.0 - self._config.filter_pole) / self._period_s
        if cutoff > 0.0:
            self._filtered = (0.0, velocity_m_s / cutoff, 0.0)

    def _regressor(self, velocity_m_s: float, command: float) -> Vector:
        """Eq. 20, [v - lambda_f v_f, v_f, s_f]; as printed lambda_f is missing."""
        pole, period = self._config.filter_pole, self._period_s
        command_f, velocity_f, sign_f = self._filtered
        command_f = pole * command_f + period * command
        velocity_f = pole * velocity_f + period * velocity_m_s
        sign_f = pole * sign_f + period * self._sign(velocity_m_s)
        self._filtered = (command_f, velocity_f, sign_f)
        return velocity_m_s - self._cutoff * velocity_f, velocity_f, sign_f

    def _sign(self, velocity_m_s: float) -> float:
        if self._config.form == "right":
            return friction_shape(velocity_m_s, self._config.dead_zone_m_s)
        scale = 1e3 if self._config.speed_unit == "mm/s" else 1.0
        return arctangent_sign(scale * velocity_m_s)

    def _learn(self, w: Vector, error: float) -> None:
        """Eq. 21-23 by explicit Euler."""
        period, gain, p = self._period_s, self._gain, self._estimate
        step = times(gain, w)
        move = period * error
        self._estimate = (p[0] - move * step[0], p[1] - move * step[1], p[2] - move * step[2])
        share = largest_eigenvalue(gain) / self._config.gain_bound
        growth = 1.0 + period * max(0.0, self._config.forgetting_rate * (1.0 - share))
        grown = reduced(gain, step, period / growth, growth)
        self._gain = _diagonal(grown) if self._config.gain_form == "diag" else grown

    def parameters(self) -> tuple[float, float, float]:
        """inertia, viscous friction, Coulomb friction."""
        return self._estimate

    def variances(self) -> tuple[float, float, float]:
        """NaN: the method gives none."""
        return math.nan, math.nan, math.nan


def _diagonal(gain: Gain) -> Gain:
    return diagonal_gain((gain[0], gain[3], gain[5]))
