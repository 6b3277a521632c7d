"""Linear-quadratic regulator with integrator, designed on the sampled axis with its delay."""

from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.dynamics import held_motion
from seamlog.contracts import Axis
from seamlog.errors import UsageError

from .feed_forward import DeadZone, feed_forward, known_of
from .pid import integral_bound
from .riccati import regulator_gains


class LQRConfig(BaseModel):
    """Sizes that weigh alike in the cost: one `error_m` costs as much as one `command`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    error_m: float = Field(0.002, gt=0)
    error_m_s: float = Field(0.05, gt=0)
    integral_m_s: float = Field(0.02, gt=0)
    """Of the integral of the error."""
    command: float | None = Field(None, gt=0)
    """Command unit; None: 0.2 m/s^2 times the inertia."""
    gains: tuple[float, ...] | None = None
    """Designed before: for integral, error, its rate, and each command under way (oldest first)."""
    integral_limit: float | None = Field(None, gt=0)
    """Bound of the integral part, command unit; None: 2.5 times the break-away force."""
    dead_zone_m_s: float = DeadZone


class LQR:
    """u = feed-forward + k z, z = (integral, e, e', feedback commands under way)."""

    Config = LQRConfig
    state_names = (
        "tracking_error_m",
        "tracking_error_m_s",
        "feed_forward_command",
        "integral_command",
        "feedback_command",
    )

    def __init__(self, config: LQRConfig, axis: Axis, period_s: float) -> None:
        self._config, self._axis, self._period_s = config, axis, period_s
        gains = design(config, axis, period_s) if config.gains is None else config.gains
        if len(gains) != 3 + axis.delay_periods:
            raise UsageError(
                f"lqr has {len(gains)} gains and needs {3 + axis.delay_periods}: integral, error, "
                f"its rate and {axis.delay_periods} commands under way"
            )
        self.gains = tuple(gains)
        self._waiting = [0.0] * axis.delay_periods
        self._bound = config.integral_limit or integral_bound(axis)
        self._known = known_of(axis, config.dead_zone_m_s)
        self._integral = 0.0
        self._state = (0.0,) * 5

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
        integral_gain, gain, rate_gain, *under_way = self.gains
        feedback = gain * error_m + rate_gain * error_m_s
        for weight, sent in zip(under_way, self._waiting, strict=True):
            feedback += weight * sent
        integral = min(max(self._integral, -self._bound), self._bound)
        self._integral = integral + integral_gain * self._period_s * error_m
        known = feed_forward(self._known, reference_m_s, reference_m_s2)
        if self._waiting:
            self._waiting = [*self._waiting[1:], feedback + integral]
        self._state = (error_m, error_m_s, known, integral, feedback)
        return known + integral + feedback

    def state(self) -> tuple[float, ...]:
        """Values in the order of `state_names`."""
        return self._state

    def warnings(self) -> list[str]:
        """Gains of another axis or period are the only limit that a design does not keep itself."""
        if self._config.gains is None:
            return []
        here = design(self._config, self._axis, self._period_s)
        off = max(abs(g - h) for g, h in zip(self.gains, here, strict=True))
        if off <= 1e-6 * max(abs(h) for h in here):
            return []
        return ["gains are not those that the weights give on this axis: stability is not assured"]


def design(config: LQRConfig, axis: Axis, period_s: float) -> tuple[float, ...]:
    """Gains for the error of `axis` without its dry friction; deterministic to the bit."""
    decay, travel, speed_gain, travel_gain = held_motion(axis, period_s)
    delay = axis.delay_periods
    size = 3 + delay
    a = [[0.0] * size for _ in range(size)]
    b = [0.0] * size
    a[0][0], a[0][1] = 1.0, period_s
    a[1][1], a[1][2] = 1.0, travel
    a[2][2] = decay
    if delay:
        a[1][3], a[2][3] = -travel_gain, -speed_gain
        for place in range(3, size - 1):
            a[place][place + 1] = 1.0
        b[-1] = 1.0
    else:
        b[1], b[2] = -travel_gain, -speed_gain
    sizes = (config.integral_m_s, config.error_m, config.error_m_s)
    weights = [1.0 / (value * value) for value in sizes] + [0.0] * delay
    command = config.command or 0.2 * axis.inertia
    return tuple(-gain for gain in regulator_gains(a, b, weights, 1.0 / (command * command)))
