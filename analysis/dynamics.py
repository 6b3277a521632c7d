"""Motion of the axis over one control period under a constant command.

    a dv/dt = command - disturbance - offset - b v - F(v)

F is set-valued at rest: the table stays where it is while the force is within +-F_s. Commands
and disturbances are in the axis' command unit, positions in m, velocities in m/s.
"""

import math
from dataclasses import dataclass, replace
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
        self._inertia, self._offset = axis.inertia, axis.offset
        self._period_s = period_s
        forward, backward = axis, backward_axis(axis)
        self._viscous = (forward.viscous_friction, backward.viscous_friction)
        self._coulomb = (forward.coulomb_friction, -backward.coulomb_friction)
        self._static = tuple(
            max(a.static_friction, a.coulomb_friction) for a in (forward, backward)
        )
        self._forward = (*held_motion(forward, period_s), self._coulomb[0])
        self._backward = (*held_motion(backward, period_s), self._coulomb[1])

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later, exact to rounding."""
        force = command - self._offset - disturbance
        if velocity_m_s > 0.0:
            decay, travel, speed_gain, travel_gain, friction = self._forward
        elif velocity_m_s < 0.0:
            decay, travel, speed_gain, travel_gain, friction = self._backward
        elif velocity_m_s == 0.0:
            return self._step_from_rest(position_m, force)
        else:
            return math.nan, math.nan
        net = force - friction
        end_m_s = decay * velocity_m_s + speed_gain * net
        if (end_m_s < 0.0) if velocity_m_s > 0.0 else (end_m_s > 0.0):
            return self._step_through_rest(position_m, velocity_m_s, force)
        return position_m + travel * velocity_m_s + travel_gain * net, end_m_s

    def _holds(self, force: float) -> bool:
        return -self._static[1] <= force <= self._static[0]

    def _step_from_rest(self, position_m: float, force: float) -> tuple[float, float]:
        if self._holds(force):
            return position_m, 0.0
        _, _, speed_gain, travel_gain, friction = self._forward if force > 0.0 else self._backward
        net = force - friction
        return position_m + travel_gain * net, speed_gain * net

    def _step_through_rest(
        self, position_m: float, velocity_m_s: float, force: float
    ) -> tuple[float, float]:
        side = 0 if velocity_m_s > 0.0 else 1
        viscous = self._viscous[side]
        pull = force - self._coulomb[side] - viscous * velocity_m_s
        share = viscous * velocity_m_s / pull
        stop_s = -velocity_m_s * self._inertia / pull * _log_slope(share)
        stop_s = min(max(stop_s, 0.0), self._period_s)
        position_m, _ = self._glide(position_m, velocity_m_s, pull, stop_s, viscous)
        if self._holds(force):
            return position_m, 0.0
        side = 0 if force > 0.0 else 1
        rest_s = self._period_s - stop_s
        pull = force - self._coulomb[side]
        return self._glide(position_m, 0.0, pull, rest_s, self._viscous[side])

    def _glide(
        self, position_m: float, velocity_m_s: float, pull: float, time_s: float, viscous: float
    ) -> tuple[float, float]:
        """`pull` is inertia times the acceleration at the start."""
        exponent = viscous * time_s / self._inertia
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
        self._substeps = substeps or max(1, round(period_s / 1e-3))
        self._step_s = period_s / self._substeps
        self._gain, self._offset = self._step_s / axis.inertia, axis.offset
        self._forward = _SlidingSide(axis, self._gain)
        self._backward = _SlidingSide(backward_axis(axis), self._gain)
        self._ripple = ripple

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later; error of the order of the sub-step."""
        gain, half_s, ripple = self._gain, 0.5 * self._step_s, self._ripple
        force = command - self._offset - disturbance
        for _ in range(self._substeps):
            push = force if ripple is None else force - self._ripple_force(position_m)
            impulse = velocity_m_s + gain * push
            side = self._forward if impulse > 0.0 else self._backward
            hold = side.hold(velocity_m_s if velocity_m_s >= 0.0 else -velocity_m_s)
            if impulse > hold:
                next_m_s = (impulse - hold) / side.damping
            elif impulse < -hold:
                next_m_s = (impulse + hold) / side.damping
            else:
                next_m_s = 0.0 if impulse == impulse else impulse
            position_m += half_s * (velocity_m_s + next_m_s)
            velocity_m_s = next_m_s
        return position_m, velocity_m_s

    def _ripple_force(self, position_m: float) -> float:
        if self._ripple is None:
            return 0.0
        return self._ripple.amplitude * math.sin(2.0 * math.pi * position_m / self._ripple.pitch_m)


class _SlidingSide:
    """Friction in one direction, as the change of speed over a sub-step."""

    def __init__(self, axis: Axis, gain: float) -> None:
        self.damping = 1.0 + gain * axis.viscous_friction
        self._axis, self._gain = axis, gain
        self._level = gain * axis.coulomb_friction
        self._excess = gain * max(0.0, axis.static_friction - axis.coulomb_friction)
        rises = self._excess > 0.0 and axis.stribeck_speed_m_s > 0.0
        self._speed_m_s = axis.stribeck_speed_m_s
        self._far_m_s = 40.0 * self._speed_m_s if rises and axis.stribeck_power == 1.0 else 0.0
        self._general = rises and axis.stribeck_power != 1.0

    def hold(self, speed_m_s: float) -> float:
        """Gain times `sliding_friction`; beyond 40 Stribeck speeds nothing of the rise is left."""
        if speed_m_s < self._far_m_s:
            return self._level + self._excess * exponential(-speed_m_s / self._speed_m_s)
        if self._general:
            return self._gain * sliding_friction(self._axis, speed_m_s)
        return self._level


def make_plant(axis: Axis, period_s: float) -> CoulombPlant | StribeckPlant:
    """The plant that fits `axis`: exact without Stribeck friction, sub-stepped with it."""
    if axis.stribeck_speed_m_s > 0.0 and axis.static_friction > axis.coulomb_friction:
        return StribeckPlant(axis, period_s)
    return CoulombPlant(axis, period_s)


def backward_axis(axis: Axis) -> Axis:
    """`axis` with the friction of motion towards negative positions as its only friction."""
    viscous, coulomb = axis.viscous_friction_negative, axis.coulomb_friction_negative
    return replace(
        axis,
        viscous_friction=axis.viscous_friction if viscous is None else viscous,
        coulomb_friction=axis.coulomb_friction if coulomb is None else coulomb,
        viscous_friction_negative=None,
        coulomb_friction_negative=None,
    )


def held_motion(axis: Axis, period_s: float) -> tuple[float, float, float, float]:
    """Exact motion of inertia and viscous friction over a period of constant net force.

    (decay, travel, speed_gain, travel_gain): the speed becomes decay v + speed_gain force, the
    position moves by travel v + travel_gain force.
    """
    exponent = axis.viscous_friction * period_s / axis.inertia
    travel = period_s * _mean_decay(exponent)
    travel_gain = period_s * period_s * _mean_travel(exponent) / axis.inertia
    return exponential(-exponent), travel, travel / axis.inertia, travel_gain


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
