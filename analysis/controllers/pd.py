"""Proportional-derivative control, the baseline; with feed-forward it is computed torque."""

from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from seamlog.contracts import Axis

from .feed_forward import NOTHING_KNOWN, DeadZone, FeedForward, feed_forward, known_of
from .law import LawController, Memory
from .stability import loop_radius, unstable_warning


class PDConfig(BaseModel):
    """Gains in the axis' command unit per m and per m/s."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kp: float | None = Field(None, ge=0)
    """Command unit per m; None: 16 1/s^2 times the inertia."""
    kd: float | None = Field(None, ge=0)
    """Command unit s/m; None: 8 1/s times the inertia (critical damping with the default kp)."""
    feed_forward: bool = False
    """Add what the axis' model needs along the reference."""
    dead_zone_m_s: float = DeadZone


class PDGains(NamedTuple):
    """Feedback, and what the model adds (all 0 without feed-forward)."""

    kp: float
    kd: float
    known: FeedForward


def pd_law(
    gains: PDGains,
    memory: Memory,
    reference_m: float,
    reference_m_s: float,
    reference_m_s2: float,
    position_m: float,
    velocity_m_s: float,
) -> tuple[float, Memory]:
    """Command before saturation; see `PD`."""
    error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
    feedback = gains.kp * error_m + gains.kd * error_m_s
    known = feed_forward(gains.known, reference_m_s, reference_m_s2)
    return feedback + known, (error_m, error_m_s, feedback, known)


class PD(LawController):
    """u = kp e + kd e' (+ a a_d + b v_d + C s(v_d))."""

    Config = PDConfig
    law = staticmethod(pd_law)
    state_names = (
        "tracking_error_m",
        "tracking_error_m_s",
        "feedback_command",
        "feed_forward_command",
    )

    def __init__(self, config: PDConfig, axis: Axis, period_s: float) -> None:
        self._kp = 16.0 * axis.inertia if config.kp is None else config.kp
        self._kd = 8.0 * axis.inertia if config.kd is None else config.kd
        known = known_of(axis, config.dead_zone_m_s) if config.feed_forward else NOTHING_KNOWN
        super().__init__(axis, period_s, PDGains(self._kp, self._kd, known))

    def warnings(self) -> list[str]:
        """Whether these gains make the linear loop unstable."""
        radius = loop_radius(self._axis, self._period_s, self._kp, self._kd)
        return unstable_warning(radius, f"kp {self._kp:.4g} with kd {self._kd:.4g}", self._axis)
