"""Super-twisting: second-order sliding mode, whose command is continuous."""

import math
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from seamlog.contracts import Axis

from .feed_forward import DeadZone, FeedForward, feed_forward, known_of
from .law import LawController, Memory
from .pid import integral_bound
from .stability import loop_radius, unstable_warning


class SuperTwistingConfig(BaseModel):
    """Tuning; forces in the axis' command unit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    surface_slope: float = Field(4.0, gt=0)
    """lambda, 1/s."""
    root_gain: float | None = Field(None, ge=0)
    """k1, command unit per (m/s)^(1/2); None: inertia x 1 (m/s)^(1/2)/s."""
    integral_gain: float | None = Field(None, ge=0)
    """k2, command unit per s; None: 0.1 1/s times the break-away force."""
    boundary_layer: float = Field(0.05, gt=0)
    """Width within which both switches are linear, m/s."""
    integral_limit: float | None = Field(None, gt=0)
    """Bound of the integral part, command unit; None: 2.5 times the break-away force."""
    dead_zone_m_s: float = DeadZone


class SuperTwistingGains(NamedTuple):
    """What the law multiplies with; `rate_period` is k2 times the period, `damping` a lambda."""

    slope: float
    damping: float
    root: float
    rate_period: float
    layer: float
    bound: float
    known: FeedForward


def super_twisting_law(
    gains: SuperTwistingGains,
    memory: Memory,
    reference_m: float,
    reference_m_s: float,
    reference_m_s2: float,
    position_m: float,
    velocity_m_s: float,
) -> tuple[float, Memory]:
    """Command before saturation; see `SuperTwisting`. The integral w is last in the memory."""
    error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
    approach = error_m_s + gains.slope * error_m
    ratio = min(max(approach / gains.layer, -1.0), 1.0)
    integral = memory[6] + gains.rate_period * ratio
    integral = min(max(integral, -gains.bound), gains.bound)
    known = feed_forward(gains.known, reference_m_s, reference_m_s2)
    damping = gains.damping * error_m_s
    switching = gains.root * math.sqrt(abs(approach)) * ratio
    memory = (-approach, error_m, error_m_s, known, damping, switching, integral)
    return known + damping + switching + integral, memory


class SuperTwisting(LawController):
    """u = a (a_d + lambda e') + b v_d + C s(v_d) + k1 |s|^(1/2) sat(s / layer) + w.

    s = e' + lambda e; w' = k2 sgn(s), linear within the layer, w bounded.
    """

    Config = SuperTwistingConfig
    law = staticmethod(super_twisting_law)
    state_names = (
        "sliding_surface_m_s",
        "tracking_error_m",
        "tracking_error_m_s",
        "feed_forward_command",
        "damping_command",
        "switching_command",
        "integral_command",
    )

    def __init__(self, config: SuperTwistingConfig, axis: Axis, period_s: float) -> None:
        self._config = config
        hold = max(axis.static_friction, axis.coulomb_friction)
        self._root = axis.inertia if config.root_gain is None else config.root_gain
        self._rate = 0.1 * hold if config.integral_gain is None else config.integral_gain
        self._bound = config.integral_limit or integral_bound(axis)
        gains = SuperTwistingGains(
            config.surface_slope,
            axis.inertia * config.surface_slope,
            self._root,
            self._rate * period_s,
            config.boundary_layer,
            self._bound,
            known_of(axis, config.dead_zone_m_s),
        )
        super().__init__(axis, period_s, gains)

    def warnings(self) -> list[str]:
        """Whether the edge of the layer, where both switches are steepest, is unstable."""
        config, axis = self._config, self._axis
        stiffness = self._root / math.sqrt(config.boundary_layer)
        rate = self._rate / config.boundary_layer
        slope = config.surface_slope
        kd = axis.inertia * slope + stiffness
        radius = loop_radius(axis, self._period_s, slope * stiffness + rate, kd, slope * rate)
        names = (
            f"surface_slope {slope:.4g}, root_gain {self._root:.4g}, integral_gain "
            f"{self._rate:.4g} over boundary_layer {config.boundary_layer:.4g}"
        )
        found = unstable_warning(radius, names, axis)
        hold = max(axis.static_friction, axis.coulomb_friction)
        if self._bound < 0.2 * hold:
            found.append(
                f"integral_limit {self._bound:.4g} {axis.unit} is below a fifth of the break-away "
                f"force {hold:.4g} {axis.unit}: little friction error can be taken up"
            )
        return found
