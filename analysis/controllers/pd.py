"""Proportional-derivative control, the baseline, with optional feed-forward of the reference."""

from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.friction import friction_shape
from seamlog.contracts import Axis


class PDConfig(BaseModel):
    """Gains in the axis' command unit per m and per m/s."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kp: float | None = Field(None, ge=0)
    """Command unit per m; None: 16 1/s^2 times the inertia."""
    kd: float | None = Field(None, ge=0)
    """Command unit s/m; None: 8 1/s times the inertia (critical damping with the default kp)."""
    feed_forward: bool = False
    """Add what the axis' model needs along the reference."""
    dead_zone_m_s: float = Field(0.0005, gt=0)
    """alpha of the friction shape, taken at the reference speed; for the feed-forward only."""


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
        feed_forward = self._feed_forward(reference_m_s, reference_m_s2)
        self._state = (error_m, error_m_s, feedback, feed_forward)
        return feedback + feed_forward

    def _feed_forward(self, reference_m_s: float, reference_m_s2: float) -> float:
        if not self._config.feed_forward:
            return 0.0
        axis = self._axis
        friction = axis.coulomb_friction * friction_shape(reference_m_s, self._config.dead_zone_m_s)
        return axis.inertia * reference_m_s2 + axis.viscous_friction * reference_m_s + friction

    def state(self) -> tuple[float, ...]:
        """Values in the order of `state_names`."""
        return self._state

    def warnings(self) -> list[str]:
        """Limits that these gains break on this axis (linear loop with its delay)."""
        lag_s = self._period_s * (0.5 + self._axis.delay_periods)
        rate = self._kd / self._axis.inertia * lag_s
        if rate < 1.0:
            return []
        return [
            f"kd x lag / inertia = {rate:.3g} is not below 1: with half a period and "
            f"{self._axis.delay_periods} of delay the loop is unstable or close to it"
        ]
