"""Motion of the axis over one control period under a constant command.

    a dv/dt = command - disturbance - offset - b v - F(v)

F is set-valued at rest: the table stays where it is while the force is within +-F_s. Commands
and disturbances are in the axis' command unit, positions in m, velocities in m/s.
"""

import math
from dataclasses import dataclass
from typing import Protocol

from seamlog.contracts import Axis

from .deterministic import exponential, log_one_plus
from .friction import sliding_friction


class Plant(Protocol):
    """An axis stepped by whole control periods."""

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later."""
        ...


@dataclass(frozen=True, slots=True)
class Ripple:
    """Force that repeats with the screw: amplitude sin(2 pi x / pitch), in the command unit."""

    amplitude: float
    pitch_m: float


class CoulombPlant:
    """Coulomb and viscous friction, stepped exactly from event to event (sign change, stick).

    Under a constant command the velocity changes sign at most once, so a period has at most two
    closed-form pieces. The Stribeck figures of `axis` are used only for the break-away force.
    """

    def __init__(self, axis: Axis, period_s: float) -> None:
        self._inertia, self._viscous = axis.inertia, axis.viscous_friction
        self._coulomb, self._offset = axis.coulomb_friction, axis.offset
        self._static = max(axis.static_friction, axis.coulomb_friction)
        self._period_s = period_s
        exponent = axis.viscous_friction * period_s / axis.inertia
        self._decay = exponential(-exponent)
        self._travel = period_s * _mean_decay(exponent)
        self._speed_gain = self._travel / axis.inertia
        self._travel_gain = period_s * period_s * _mean_travel(exponent) / axis.inertia

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later, exact to rounding."""
        force = command - self._offset - disturbance
        if velocity_m_s == 0.0:
            if -self._static <= force <= self._static:
                return position_m, 0.0
            net = force - self._coulomb if force > 0.0 else force + self._coulomb
            return position_m + self._travel_gain * net, self._speed_gain * net
        net = force - self._coulomb if velocity_m_s > 0.0 else force + self._coulomb
        end_m_s = self._decay * velocity_m_s + self._speed_gain * net
        if end_m_s * velocity_m_s < 0.0:
            return self._step_through_rest(position_m, velocity_m_s, force, net)
        position_m += self._travel * velocity_m_s + self._travel_gain * net
        return position_m, end_m_s

    def _step_through_rest(
        self, position_m: float, velocity_m_s: float, force: float, net: float
    ) -> tuple[float, float]:
        pull = net - self._viscous * velocity_m_s
        share = self._viscous * velocity_m_s / pull
        stop_s = -velocity_m_s * self._inertia / pull * _log_slope(share)
        stop_s = min(max(stop_s, 0.0), self._period_s)
        position_m, _ = self._glide(position_m, velocity_m_s, pull, stop_s)
        if -self._static <= force <= self._static:
            return position_m, 0.0
        pull = force - self._coulomb if force > 0.0 else force + self._coulomb
        return self._glide(position_m, 0.0, pull, self._period_s - stop_s)

    def _glide(
        self, position_m: float, velocity_m_s: float, pull: float, time_s: float
    ) -> tuple[float, float]:
        """`pull` is inertia times the acceleration at the start."""
        exponent = self._viscous * time_s / self._inertia
        start_m_s2 = pull / self._inertia
        position_m += velocity_m_s * time_s
        position_m += start_m_s2 * time_s * time_s * _mean_travel(exponent)
        return position_m, velocity_m_s + start_m_s2 * time_s * _mean_decay(exponent)


class StribeckPlant:
    """Stribeck friction (eq. 2), stepped implicitly in `substeps` parts of the period.

    The friction level is taken at the start of a sub-step, its sign and the stick are implicit,
    so the step is stable for any friction. `ripple` depends on the position.
    """

    def __init__(
        self, axis: Axis, period_s: float, substeps: int = 0, ripple: Ripple | None = None
    ) -> None:
        self._axis = axis
        self._substeps = substeps or max(1, round(period_s / 1e-3))
        self._step_s = period_s / self._substeps
        self._ripple = ripple

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later; error of the order of the sub-step."""
        axis, step_s = self._axis, self._step_s
        gain = step_s / axis.inertia
        damping = 1.0 + gain * axis.viscous_friction
        force = command - axis.offset - disturbance
        for _ in range(self._substeps):
            impulse = velocity_m_s + gain * (force - self._ripple_force(position_m))
            hold = gain * sliding_friction(axis, abs(velocity_m_s))
            if impulse > hold:
                next_m_s = (impulse - hold) / damping
            elif impulse < -hold:
                next_m_s = (impulse + hold) / damping
            else:
                next_m_s = 0.0
            position_m += 0.5 * step_s * (velocity_m_s + next_m_s)
            velocity_m_s = next_m_s
        return position_m, velocity_m_s

    def _ripple_force(self, position_m: float) -> float:
        if self._ripple is None:
            return 0.0
        return self._ripple.amplitude * math.sin(2.0 * math.pi * position_m / self._ripple.pitch_m)


def make_plant(axis: Axis, period_s: float) -> CoulombPlant | StribeckPlant:
    """The plant that fits `axis`: exact without Stribeck friction, sub-stepped with it."""
    if axis.stribeck_speed_m_s > 0.0 and axis.static_friction > axis.coulomb_friction:
        return StribeckPlant(axis, period_s)
    return CoulombPlant(axis, period_s)


def axis_from_datasheet(
    *,
    motor_inertia_kg_m2: float,
    screw_inertia_kg_m2: float,
    load_kg: float,
    lead_m: float,
    viscous_friction_n_s_m: float = 0.0,
    coulomb_friction_n: float = 0.0,
) -> Axis:
    """Eq. 1: the axis a motor sees, command in N m.

    a = J / r + r M with r = lead / (2 pi), in N m s^2/m; friction forces at the table become
    motor torques by the same r.
    """
    ratio_m = lead_m / (2.0 * math.pi)
    inertia = (motor_inertia_kg_m2 + screw_inertia_kg_m2) / ratio_m + ratio_m * load_kg
    return Axis(inertia, ratio_m * viscous_friction_n_s_m, ratio_m * coulomb_friction_n, unit="N m")


def _mean_decay(exponent: float) -> float:
    """(1 - exp(-z)) / z, 1 at z = 0."""
    if exponent > 1.0:
        return (1.0 - exponential(-exponent)) / exponent
    return _decay_series(exponent, 1)


def _mean_travel(exponent: float) -> float:
    """(z - 1 + exp(-z)) / z^2, 1/2 at z = 0."""
    if exponent > 1.0:
        return (exponent - 1.0 + exponential(-exponent)) / (exponent * exponent)
    return 0.5 * _decay_series(exponent, 2)


def _decay_series(exponent: float, order: int) -> float:
    """Order! times the sum of (-z)^k / (k + order)!, for z in [0, 1]."""
    total = 1.0
    for k in range(18, 0, -1):
        total = 1.0 - exponent * total / (k + order)
    return total


def _log_slope(x: float) -> float:
    """log(1 + x) / x, 1 at x = 0."""
    return log_one_plus(x) / x if x != 0.0 else 1.0
