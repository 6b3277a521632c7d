"""Discontinuous sliding mode (eq. 10): friction and inertia compensated, the sign of S switched.

S' = -eta sgn S - (K sgn S + f) / a, so S reaches 0 within |S(0)| / eta; sampled and delayed it
chatters about S = 0 instead of staying there.
"""

import math
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.friction import friction_shape, smallest_dead_zone_m_s
from seamlog.contracts import Axis

from .law import LawController, Memory


class SignConfig(BaseModel):
    """Tuning of the discontinuous law."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    surface_slope: float = Field(3.5, gt=0)
    """lambda, 1/s."""
    gain: float | None = Field(None, ge=0)
    """K, command unit; None: the larger of static and Coulomb friction, as eq. 5 requires."""
    reach_rate: float = Field(0.05, ge=0)
    """eta, m/s^2."""
    dead_zone_m_s: float = Field(0.007, gt=0)
    """alpha of the friction shape."""


class SignGains(NamedTuple):
    """What eq. 10 multiplies with; `switching` is a eta + K."""

    inertia: float
    viscous: float
    coulomb: float
    switching: float
    slope: float
    reach_rate: float
    dead_zone_m_s: float


def sign_law(
    gains: SignGains,
    memory: Memory,
    reference_m: float,
    reference_m_s: float,
    reference_m_s2: float,
    position_m: float,
    velocity_m_s: float,
) -> tuple[float, Memory]:
    """Eq. 10, before saturation."""
    error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
    approach = error_m_s + gains.slope * error_m
    friction = gains.viscous * velocity_m_s
    friction += gains.coulomb * friction_shape(velocity_m_s, gains.dead_zone_m_s)
    tracking = gains.inertia * (reference_m_s2 + gains.slope * error_m_s)
    switching = math.copysign(gains.switching, approach) if approach != 0.0 else 0.0
    reach_s = abs(approach) / gains.reach_rate if gains.reach_rate > 0.0 else math.inf
    memory = (-approach, error_m, error_m_s, friction, tracking, switching, reach_s)
    return friction + tracking + switching, memory


class SignController(LawController):
    """u = b v + C s(v) + a (a_d + lambda e') + (a eta + K) sgn(e' + lambda e)."""

    Config = SignConfig
    law = staticmethod(sign_law)
    state_names = (
        "sliding_surface_m_s",
        "tracking_error_m",
        "tracking_error_m_s",
        "friction_command",
        "tracking_command",
        "switching_command",
        "reaching_time_s",
    )

    def __init__(self, config: SignConfig, axis: Axis, period_s: float) -> None:
        self._config = config
        self._hold = max(axis.static_friction, axis.coulomb_friction)
        self._gain = self._hold if config.gain is None else config.gain
        self._switching = axis.inertia * config.reach_rate + self._gain
        gains = SignGains(
            axis.inertia,
            axis.viscous_friction,
            axis.coulomb_friction,
            self._switching,
            config.surface_slope,
            config.reach_rate,
            config.dead_zone_m_s,
        )
        super().__init__(axis, period_s, gains)

    def warnings(self) -> list[str]:
        """Limits that this tuning breaks on this axis; without a layer it always chatters."""
        config, axis = self._config, self._axis
        lag_s = self._period_s * (0.5 + axis.delay_periods)
        crossing_m_s = self._switching / axis.inertia * lag_s
        found = [
            f"no boundary layer: with {lag_s:.3g} s of lag the surface is crossed by about "
            f"{crossing_m_s:.3g} m/s each time; expect chatter of the command by "
            f"{self._switching:.4g} {axis.unit}"
        ]
        if config.surface_slope * lag_s >= SLOPE_LIMIT:
            found.append(
                f"surface_slope x lag = {config.surface_slope * lag_s:.3g} is not below "
                f"{SLOPE_LIMIT}: the linear part is unstable with this delay"
            )
        if self._gain < self._hold:
            found.append(
                f"gain {self._gain:.4g} {axis.unit} is below the static friction "
                f"{self._hold:.4g} {axis.unit}: reaching the surface is not assured (eq. 5)"
            )
        least_m_s = smallest_dead_zone_m_s(axis)
        if config.dead_zone_m_s < least_m_s:
            found.append(
                f"dead_zone_m_s {config.dead_zone_m_s:.4g} is below {least_m_s:.4g}: the friction "
                "shape overtakes the Stribeck curve (eq. 5)"
            )
        return found


SLOPE_LIMIT = 0.647
"""Of lambda times lag, for the linear part of the law."""
