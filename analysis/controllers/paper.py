"""The paper's law: computed torque, PD and a boundary-layer switching term (eq. 12).

With e = x_d - x the sliding surface is S = -(e' + lambda e), and

    u = b v + C s(v) + a (a_d + c lambda e' + lambda^2 e) + (a eta + K) sat((e' + lambda e) / Phi)

where c = 2 (the paper prints 1, which gives half the damping that its eq. 13 claims).
"""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.friction import friction_shape, smallest_dead_zone_m_s
from seamlog.contracts import Axis

from .law import LawController, Memory


class PaperConfig(BaseModel):
    """Tuning of the paper's law; lengths in m, times in s, forces in the axis' command unit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    surface_slope: float = Field(3.5, gt=0)
    """lambda, 1/s."""
    gain: float | None = Field(None, ge=0)
    """K, command unit; None: the larger of static and Coulomb friction, as eq. 5 requires."""
    boundary_layer: float = Field(0.1, gt=0)
    """Phi, m/s."""
    reach_rate: float = Field(0.0, ge=0)
    """eta, m/s^2."""
    dead_zone_m_s: float = Field(0.007, gt=0)
    """alpha of the friction shape."""
    form: Literal["right", "as_printed"] = "right"
    friction_speed: Literal["measured", "reference"] = "measured"
    """Speed at which friction is compensated; the paper takes the measured one."""


PaperGains = tuple[float, float, float, float, float, float, float, float, float, bool]
"""What eq. 12 multiplies with, in the order in which `paper_law` unpacks it."""


def paper_law(
    gains: PaperGains,
    memory: Memory,
    reference_m: float,
    reference_m_s: float,
    reference_m_s2: float,
    position_m: float,
    velocity_m_s: float,
) -> tuple[float, Memory]:
    """Eq. 12, before saturation."""
    inertia, viscous, coulomb, reach, slope, damping, stiffness, layer, alpha, on_reference = gains
    error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
    approach = error_m_s + slope * error_m
    speed = reference_m_s if on_reference else velocity_m_s
    friction = viscous * speed
    friction += coulomb * friction_shape(speed, alpha)
    wanted_m_s2 = reference_m_s2 + damping * error_m_s + stiffness * error_m
    tracking = inertia * wanted_m_s2
    ratio = approach / layer
    switching = reach * (1.0 if ratio > 1.0 else -1.0 if ratio < -1.0 else ratio)
    memory = (-approach, error_m, error_m_s, friction, tracking, switching)
    return friction + tracking + switching, memory


class PaperController(LawController):
    """Eq. 12 with the parameters of `axis`, or those that `adapt` has set since."""

    Config = PaperConfig
    law = staticmethod(paper_law)
    state_names = (
        "sliding_surface_m_s",
        "tracking_error_m",
        "tracking_error_m_s",
        "friction_command",
        "tracking_command",
        "switching_command",
    )

    def __init__(self, config: PaperConfig, axis: Axis, period_s: float) -> None:
        self._config = config
        static = max(axis.static_friction, axis.coulomb_friction)
        self._gain = static if config.gain is None else config.gain
        slope = config.surface_slope
        damping = slope * (2.0 if config.form == "right" else 1.0)
        self._on_reference = config.friction_speed == "reference"
        shape = (config.boundary_layer, config.dead_zone_m_s, self._on_reference)
        self._tuning = (slope, damping, slope * slope, *shape)
        super().__init__(axis, period_s, None)
        self.adapt(axis.inertia, axis.viscous_friction, axis.coulomb_friction)

    def adapt(self, inertia: float, viscous_friction: float, coulomb_friction: float) -> None:
        """Take new plant parameters, as a self-tuning loop does each period."""
        switching = inertia * self._config.reach_rate + self._gain
        self.gains = (inertia, viscous_friction, coulomb_friction, switching, *self._tuning)

    def warnings(self) -> list[str]:
        """Limits that this tuning breaks on this axis, each named with its numbers."""
        return [*self._delay_warnings(), *self._friction_warnings()]

    def _delay_warnings(self) -> list[str]:
        config = self._config
        lag_s = self._period_s * (0.5 + self._axis.delay_periods)
        found = []
        bound = 0.647 if config.form == "right" else 0.711
        if config.surface_slope * lag_s >= bound:
            found.append(
                f"surface_slope x lag = {config.surface_slope * lag_s:.3g} is not below {bound}: "
                f"with half a period and {self._axis.delay_periods} of delay the loop is unstable"
            )
        inertia, _, _, reach, *_ = self.gains
        layer_rate = reach / (inertia * config.boundary_layer)
        if (2.0 * config.surface_slope + layer_rate) * lag_s >= 0.6:
            found.append(
                f"(2 surface_slope + {layer_rate:.3g} 1/s in the layer) x lag = "
                f"{(2.0 * config.surface_slope + layer_rate) * lag_s:.3g} is not below 0.6: "
                "expect a limit cycle; widen boundary_layer or lower gain"
            )
        return found

    def _friction_warnings(self) -> list[str]:
        axis, found = self._axis, []
        static = max(axis.static_friction, axis.coulomb_friction)
        if self._gain < static:
            found.append(
                f"gain {self._gain:.4g} {axis.unit} is below the static friction {static:.4g} "
                f"{axis.unit}: reaching the surface is not assured (eq. 5)"
            )
        least_m_s = 0.0 if self._on_reference else smallest_dead_zone_m_s(axis)
        if self._config.dead_zone_m_s < least_m_s:
            found.append(
                f"dead_zone_m_s {self._config.dead_zone_m_s:.4g} is below {least_m_s:.4g}: the "
                "friction shape overtakes the Stribeck curve (eq. 5)"
            )
        return found
