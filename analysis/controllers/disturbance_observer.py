"""A disturbance observer around any controller: what the axis' model misses is sent along.

Over each period of sliding the force that the model does not explain is

    r = u - (a dv + b dx) / T - C sgn(v) - offset

and the estimate follows it by d += gain (r - d).
"""

from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.dynamics import backward_axis
from seamlog.contracts import Axis

from .inner import InnerController, warnings_of, with_state
from .sent import SentCommands


class DisturbanceObserverConfig(BaseModel):
    """What is observed and how fast."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    controller: InnerController = InnerController(name="pd", config={"feed_forward": True})
    gain: float = Field(0.2, gt=0, le=1)
    """Share of the new residual in the estimate, per period."""
    gate_m_s: float = Field(0.004, ge=0)
    """Periods with a slower end teach nothing: the sign of friction is not known there."""
    limit: float | None = Field(None, gt=0)
    """Bound of the estimate, command unit; None: half the saturation."""


class DisturbanceObserver:
    """u = u of the inner controller + estimated disturbance."""

    Config = DisturbanceObserverConfig

    def __init__(self, config: DisturbanceObserverConfig, axis: Axis, period_s: float) -> None:
        self._config, self._period_s = config, period_s
        self._forward, self._backward = axis, backward_axis(axis)
        self._inner = config.controller.make(axis, period_s)
        self._sent = SentCommands(axis)
        self._bound = config.limit or 0.5 * axis.saturation
        self._last: tuple[float, float] | None = None
        self._disturbance = 0.0
        self.state_names = with_state(self._inner, "disturbance_command")

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: float,
        velocity_m_s: float,
    ) -> float:
        """Command before saturation."""
        self._observe(position_m, velocity_m_s, self._sent.arrive())
        wanted = self._disturbance + self._inner.output(
            reference_m, reference_m_s, reference_m_s2, position_m, velocity_m_s
        )
        self._sent.send(wanted)
        return wanted

    def _observe(self, position_m: float, velocity_m_s: float, acted: float) -> None:
        last, self._last = self._last, (position_m, velocity_m_s)
        if last is None:
            return
        before_m, before_m_s = last
        gate = self._config.gate_m_s
        if before_m_s > gate and velocity_m_s > gate:
            axis, friction = self._forward, self._forward.coulomb_friction
        elif before_m_s < -gate and velocity_m_s < -gate:
            axis, friction = self._backward, -self._backward.coulomb_friction
        else:
            return
        moved = axis.inertia * (velocity_m_s - before_m_s)
        moved += axis.viscous_friction * (position_m - before_m)
        residual = acted - moved / self._period_s - friction - axis.offset
        disturbance = self._disturbance + self._config.gain * (residual - self._disturbance)
        self._disturbance = min(max(disturbance, -self._bound), self._bound)

    def state(self) -> tuple[float, ...]:
        """States of the inner controller and the estimate, in the order of `state_names`."""
        return (*self._inner.state(), self._disturbance)

    def warnings(self) -> list[str]:
        """Those of the inner controller, and an observer faster than the delay allows."""
        found = warnings_of(self._inner)
        most = 1.0 / (1.0 + self._forward.delay_periods)
        if self._config.gain > most:
            found.append(
                f"gain {self._config.gain:.3g} of the observer is above {most:.3g}: with "
                f"{self._forward.delay_periods} of delay it answers its own corrections"
            )
        return found
