"""Proportional-integral-derivative control with a bounded integral and optional feed-forward."""

from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from seamlog.contracts import Axis

from .feed_forward import NOTHING_KNOWN, DeadZone, FeedForward, feed_forward, known_of
from .law import LawController, Memory
from .stability import loop_radius, unstable_warning


class PIDConfig(BaseModel):
    """Gains in the axis' command unit per m, per m s and per m/s."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kp: float | None = Field(None, ge=0)
    """Command unit per m; None: 16 1/s^2 times the inertia."""
    ki: float | None = Field(None, ge=0)
    """Command unit per m s; None: 8 1/s^3 times the inertia."""
    kd: float | None = Field(None, ge=0)
    """Command unit s/m; None: 8 1/s times the inertia."""
    integral_limit: float | None = Field(None, gt=0)
    """Bound of the integral part, command unit; None: 2.5 times the break-away force."""
    feed_forward: bool = False
    """Add what the axis' model needs along the reference."""
    dead_zone_m_s: float = DeadZone


class PIDGains(NamedTuple):
    """Feedback with ki a period, the bound of its integral, and what the model adds."""

    kp: float
    ki_period: float
    kd: float
    bound: float
    known: FeedForward


def pid_law(
    gains: PIDGains,
    memory: Memory,
    reference_m: float,
    reference_m_s: float,
    reference_m_s2: float,
    position_m: float,
    velocity_m_s: float,
) -> tuple[float, Memory]:
    """Command before saturation; see `PID`. The integral is the fourth value of the memory."""
    error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
    integral = memory[3] + gains.ki_period * error_m
    integral = min(max(integral, -gains.bound), gains.bound)
    feedback = gains.kp * error_m + gains.kd * error_m_s
    known = feed_forward(gains.known, reference_m_s, reference_m_s2)
    return feedback + integral + known, (error_m, error_m_s, feedback, integral, known)


class PID(LawController):
    """u = kp e + kd e' + I (+ a a_d + b v_d + C s(v_d)), I the sum of ki e T, bounded."""

    Config = PIDConfig
    law = staticmethod(pid_law)
    state_names = (
        "tracking_error_m",
        "tracking_error_m_s",
        "feedback_command",
        "integral_command",
        "feed_forward_command",
    )

    def __init__(self, config: PIDConfig, axis: Axis, period_s: float) -> None:
        self._config = config
        self._kp = 16.0 * axis.inertia if config.kp is None else config.kp
        self._ki = 8.0 * axis.inertia if config.ki is None else config.ki
        self._kd = 8.0 * axis.inertia if config.kd is None else config.kd
        self._bound = config.integral_limit or integral_bound(axis)
        known = known_of(axis, config.dead_zone_m_s) if config.feed_forward else NOTHING_KNOWN
        gains = PIDGains(self._kp, self._ki * period_s, self._kd, self._bound, known)
        super().__init__(axis, period_s, gains)

    def warnings(self) -> list[str]:
        """Whether the linear loop is unstable or the integral cannot overcome friction."""
        kp, ki, kd, axis = self._kp, self._ki, self._kd, self._axis
        radius = loop_radius(axis, self._period_s, kp, kd, ki)
        found = unstable_warning(radius, f"kp {kp:.4g}, ki {ki:.4g}, kd {kd:.4g}", axis)
        hold = max(axis.static_friction, axis.coulomb_friction)
        if ki > 0.0 and self._bound < hold and not self._config.feed_forward:
            found.append(
                f"integral_limit {self._bound:.4g} {axis.unit} is below the break-away force "
                f"{hold:.4g} {axis.unit}: a table at rest may stay off the reference"
            )
        return found


def integral_bound(axis: Axis) -> float:
    """2.5 times the break-away force of `axis`; its saturation where it has no dry friction."""
    return 2.5 * max(axis.static_friction, axis.coulomb_friction) or axis.saturation
