"""Active disturbance rejection: an observer estimates everything the double integrator lacks.

The axis is taken for x'' = u / a + z3; viscous friction, dry friction and load are all in z3.
The observer corrects with each sample (poles of one bandwidth) and is carried over the delay
with the commands under way.
"""

from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.deterministic import exponential
from seamlog.contracts import Axis

from .feed_forward import NOTHING_KNOWN, DeadZone, feed_forward, known_of
from .sent import SentCommands


class ADRCConfig(BaseModel):
    """Bandwidths of feedback and observer."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    bandwidth_1_s: float = Field(6.0, gt=0)
    """Of the feedback: kp = bandwidth^2, kd = 2 damping bandwidth."""
    damping: float = Field(1.0, gt=0)
    observer_bandwidth_1_s: float = Field(15.0, gt=0)
    feed_forward: bool = True
    """Give the observer only what the axis' model does not explain."""
    dead_zone_m_s: float = DeadZone


class ADRC:
    """u = a (a_d + kd e' + kp e - z3), e and e' from the observer; friction known or in z3."""

    Config = ADRCConfig
    state_names = (
        "tracking_error_m",
        "tracking_error_m_s",
        "observed_velocity_m_s",
        "disturbance_m_s2",
        "feed_forward_command",
        "feedback_command",
    )

    def __init__(self, config: ADRCConfig, axis: Axis, period_s: float) -> None:
        self._config, self._axis, self._period_s = config, axis, period_s
        pole = exponential(-config.observer_bandwidth_1_s * period_s)
        rest = 1.0 - pole
        self._gains = (
            1.0 - pole * pole * pole,
            1.5 * rest * rest * (1.0 + pole) / period_s,
            rest * rest * rest / (period_s * period_s),
        )
        self._kp = config.bandwidth_1_s * config.bandwidth_1_s
        self._kd = 2.0 * config.damping * config.bandwidth_1_s
        self._sent = SentCommands(axis)
        model = known_of(axis, config.dead_zone_m_s)
        self._model = model if config.feed_forward else NOTHING_KNOWN
        self._known = [0.0] * (axis.delay_periods + 1)
        self._observed: tuple[float, float, float] | None = None
        self._state = (0.0,) * 6

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
        z = self._observe(position_m, velocity_m_s)
        ahead_s = self._axis.delay_periods * self._period_s
        for sent, known in zip(self._sent.due, self._known, strict=True):
            z = self._moved(z, sent - known)
        asked_m = reference_m + ahead_s * (reference_m_s + 0.5 * ahead_s * reference_m_s2)
        asked_m_s = reference_m_s + ahead_s * reference_m_s2
        pull = self._kp * (asked_m - z[0]) + self._kd * (asked_m_s - z[1]) - z[2]
        known = self._friction(asked_m_s)
        feedback = self._axis.inertia * pull
        wanted = known + self._axis.inertia * reference_m_s2 + feedback
        self._sent.send(wanted)
        self._known.append(known)
        self._state = (error_m, error_m_s, z[1], z[2], wanted - feedback, feedback)
        return wanted

    def _friction(self, speed_m_s: float) -> float:
        return feed_forward(self._model, speed_m_s, 0.0)

    def _observe(self, position_m: float, velocity_m_s: float) -> tuple[float, float, float]:
        acted = self._sent.arrive() - self._known.pop(0)
        if self._observed is None:
            self._observed = (position_m, velocity_m_s, 0.0)
            return self._observed
        z1, z2, z3 = self._moved(self._observed, acted)
        miss_m = position_m - z1
        g1, g2, g3 = self._gains
        self._observed = (z1 + g1 * miss_m, z2 + g2 * miss_m, z3 + g3 * miss_m)
        return self._observed

    def _moved(self, z: tuple[float, float, float], force: float) -> tuple[float, float, float]:
        period = self._period_s
        rate = z[2] + force / self._axis.inertia
        return z[0] + period * (z[1] + 0.5 * period * rate), z[1] + period * rate, z[2]

    def state(self) -> tuple[float, ...]:
        """Values in the order of `state_names`."""
        return self._state

    def warnings(self) -> list[str]:
        """Bandwidths that do not fit each other or the lag."""
        config, found = self._config, []
        lag_s = self._period_s * (0.5 + self._axis.delay_periods)
        if config.observer_bandwidth_1_s < 2.0 * config.bandwidth_1_s:
            found.append(
                f"observer_bandwidth_1_s {config.observer_bandwidth_1_s:.3g} is below twice "
                f"bandwidth_1_s {config.bandwidth_1_s:.3g}: the feedback outruns its observer"
            )
        if config.bandwidth_1_s * lag_s >= 0.7:
            found.append(
                f"bandwidth_1_s x lag = {config.bandwidth_1_s * lag_s:.3g} is not below 0.7: the "
                "double integrator with its observer and delay is close to unstable"
            )
        return found
