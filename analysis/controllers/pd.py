"""Proportional-derivative control, the baseline; with feed-forward it is computed torque."""

from pydantic import BaseModel, ConfigDict, Field

from seamlog.contracts import Axis

from .feed_forward import DeadZone, feed_forward
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


class PD:
    """u = kp e + kd e' (+ a a_d + b v_d + C s(v_d))."""

    Config = PDConfig
    state_names = (
        "tracking_error_m",
        "tracking_error_m_s",
        "feedback_command",
        "feed_forward_command",
    )

    def __init__(self, config: PDConfig, axis: Axis, period_s: float) -> None:
        self._config, self._axis, self._period_s = config, axis, period_s
        self._kp = 16.0 * axis.inertia if config.kp is None else config.kp
        self._kd = 8.0 * axis.inertia if config.kd is None else config.kd
        self._state = (0.0,) * 4

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: float,
        velocity_m_s: float,
    ) -> float:
        """Command before saturation."""
        error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
        feedback = self._kp * error_m + self._kd * error_m_s
        known = self._feed_forward(reference_m_s, reference_m_s2)
        self._state = (error_m, error_m_s, feedback, known)
        return feedback + known

    def _feed_forward(self, reference_m_s: float, reference_m_s2: float) -> float:
        if not self._config.feed_forward:
            return 0.0
        return feed_forward(self._axis, self._config.dead_zone_m_s, reference_m_s, reference_m_s2)

    def state(self) -> tuple[float, ...]:
        """Values in the order of `state_names`."""
        return self._state

    def warnings(self) -> list[str]:
        """Whether these gains make the linear loop unstable."""
        radius = loop_radius(self._axis, self._period_s, self._kp, self._kd)
        return unstable_warning(radius, f"kp {self._kp:.4g} with kd {self._kd:.4g}", self._axis)
