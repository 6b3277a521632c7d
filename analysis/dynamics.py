"""Motion of the axis over one control period under a constant command.

    a dv/dt = command - disturbance - offset - b v - F(v)

F is set-valued at rest: the table stays where it is while the force is within +-F_s. Commands
and disturbances are in the axis' command unit, positions in m, velocities in m/s.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

from seamlog.contracts import Axis

from .deterministic import exponential, log_one_plus
from .friction import stribeck_rise


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


Side = tuple[float, float, float, float, float, float, float]
"""Motion in one direction: decay, travel, speed_gain, travel_gain over a whole period (see
`held_motion`), Coulomb force with the sign of the direction, viscous coefficient, break-away force.

A plain tuple, as its unpacking is the quickest way to seven numbers.
"""


class CoulombConstants(NamedTuple):
    """What `coulomb_step` knows of an axis and its period."""

    forward: Side
    backward: Side
    inertia: float
    offset: float
    period_s: float


def _side(axis: Axis, sense: float, period_s: float) -> Side:
    static = max(axis.static_friction, axis.coulomb_friction)
    coulomb = sense * axis.coulomb_friction
    return (*held_motion(axis, period_s), coulomb, axis.viscous_friction, static)


def coulomb_step(
    plant: CoulombConstants,
    position_m: float,
    velocity_m_s: float,
    command: float,
    disturbance: float,
) -> tuple[float, float]:
    """Position and velocity one period later, exact to rounding; see `CoulombPlant`."""
    force = command - plant.offset - disturbance
    if velocity_m_s > 0.0:
        decay, travel, speed_gain, travel_gain, friction, viscous, _ = plant.forward
    elif velocity_m_s < 0.0:
        decay, travel, speed_gain, travel_gain, friction, viscous, _ = plant.backward
    elif velocity_m_s == 0.0:
        return _step_from_rest(plant, position_m, force)
    else:
        return math.nan, math.nan
    net = force - friction
    end_m_s = decay * velocity_m_s + speed_gain * net
    if (end_m_s < 0.0) if velocity_m_s > 0.0 else (end_m_s > 0.0):
        return _step_through_rest(plant, position_m, velocity_m_s, force, net, viscous)
    return position_m + travel * velocity_m_s + travel_gain * net, end_m_s


def _holds(plant: CoulombConstants, force: float) -> bool:
    return -plant.backward[6] <= force <= plant.forward[6]


def _step_from_rest(
    plant: CoulombConstants, position_m: float, force: float
) -> tuple[float, float]:
    if _holds(plant, force):
        return position_m, 0.0
    _, _, speed_gain, travel_gain, friction, _, _ = plant.forward if force > 0.0 else plant.backward
    net = force - friction
    return position_m + travel_gain * net, speed_gain * net


def _step_through_rest(
    plant: CoulombConstants,
    position_m: float,
    velocity_m_s: float,
    force: float,
    net: float,
    viscous: float,
) -> tuple[float, float]:
    """`net` is the force less Coulomb friction, until the axis comes to rest."""
    pull = net - viscous * velocity_m_s
    share = viscous * velocity_m_s / pull
    stop_s = -velocity_m_s * plant.inertia / pull * _log_slope(share)
    stop_s = min(max(stop_s, 0.0), plant.period_s)
    position_m, _ = _glide(position_m, velocity_m_s, pull, stop_s, viscous, plant.inertia)
    if _holds(plant, force):
        return position_m, 0.0
    _, _, _, _, friction, viscous, _ = plant.forward if force > 0.0 else plant.backward
    rest_s = plant.period_s - stop_s
    return _glide(position_m, 0.0, force - friction, rest_s, viscous, plant.inertia)


def _glide(
    position_m: float,
    velocity_m_s: float,
    pull: float,
    time_s: float,
    viscous: float,
    inertia: float,
) -> tuple[float, float]:
    """`pull` is inertia times the acceleration at the start."""
    exponent = viscous * time_s / inertia
    start_m_s2 = pull / inertia
    position_m += velocity_m_s * time_s
    position_m += start_m_s2 * time_s * time_s * _mean_travel(exponent)
    return position_m, velocity_m_s + start_m_s2 * time_s * _mean_decay(exponent)


class CoulombPlant:
    """Coulomb and viscous friction, stepped exactly from event to event (sign change, stick).

    Under a constant command the velocity changes sign at most once, so a period has at most two
    closed-form pieces. The Stribeck figures of `axis` are used only for the break-away force.
    """

    kernel = staticmethod(coulomb_step)

    def __init__(self, axis: Axis, period_s: float) -> None:
        sides = (_side(axis, 1.0, period_s), _side(backward_axis(axis), -1.0, period_s))
        self.constants = CoulombConstants(*sides, axis.inertia, axis.offset, period_s)

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later, exact to rounding."""
        return coulomb_step(self.constants, position_m, velocity_m_s, command, disturbance)


class SlidingSide(NamedTuple):
    """Friction in one direction, as the change of speed over a sub-step."""

    damping: float
    level: float
    excess: float
    speed_m_s: float
    power: float


class StribeckConstants(NamedTuple):
    """What `stribeck_step` knows of an axis and its sub-step."""

    forward: SlidingSide
    backward: SlidingSide
    substeps: int
    step_s: float
    gain: float
    offset: float
    ripple: float
    pitch_m: float


def _sliding_side(axis: Axis, gain: float) -> SlidingSide:
    excess = gain * max(0.0, axis.static_friction - axis.coulomb_friction)
    speed_m_s = axis.stribeck_speed_m_s if excess > 0.0 else 0.0
    damping, level = 1.0 + gain * axis.viscous_friction, gain * axis.coulomb_friction
    return SlidingSide(damping, level, excess, speed_m_s, axis.stribeck_power)


def stribeck_step(
    plant: StribeckConstants,
    position_m: float,
    velocity_m_s: float,
    command: float,
    disturbance: float,
) -> tuple[float, float]:
    """Position and velocity one period later; see `StribeckPlant`."""
    gain, half_s, ripple = plant.gain, 0.5 * plant.step_s, plant.ripple
    force = command - plant.offset - disturbance
    for _ in range(plant.substeps):
        push = force
        if ripple != 0.0:
            push = force - ripple * math.sin(2.0 * math.pi * position_m / plant.pitch_m)
        impulse = velocity_m_s + gain * push
        side = plant.forward if impulse > 0.0 else plant.backward
        hold = _hold(side, velocity_m_s if velocity_m_s >= 0.0 else -velocity_m_s)
        if impulse > hold:
            next_m_s = (impulse - hold) / side.damping
        elif impulse < -hold:
            next_m_s = (impulse + hold) / side.damping
        else:
            next_m_s = 0.0 if impulse == impulse else impulse
        position_m += half_s * (velocity_m_s + next_m_s)
        velocity_m_s = next_m_s
    return position_m, velocity_m_s


def _hold(side: SlidingSide, speed_m_s: float) -> float:
    """Gain times `sliding_friction`; beyond 40 Stribeck speeds nothing of the rise is left."""
    if side.speed_m_s == 0.0:
        return side.level
    if side.power == 1.0:
        if speed_m_s >= 40.0 * side.speed_m_s:
            return side.level
        return side.level + side.excess * exponential(-speed_m_s / side.speed_m_s)
    return side.level + side.excess * stribeck_rise(speed_m_s / side.speed_m_s, side.power)


class StribeckPlant:
    """Stribeck friction (eq. 2), stepped implicitly in `substeps` parts of the period.

    The friction level is taken at the start of a sub-step, its sign and the stick are implicit,
    so the step is stable for any friction. `ripple` depends on the position.
    """

    kernel = staticmethod(stribeck_step)

    def __init__(
        self, axis: Axis, period_s: float, substeps: int = 0, ripple: Ripple | None = None
    ) -> None:
        substeps = substeps or max(1, round(period_s / 1e-3))
        step_s = period_s / substeps
        gain = step_s / axis.inertia
        sides = (_sliding_side(axis, gain), _sliding_side(backward_axis(axis), gain))
        wave = ripple or Ripple(0.0, 1.0)
        self.constants = StribeckConstants(
            *sides, substeps, step_s, gain, axis.offset, wave.amplitude, wave.pitch_m
        )

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later; error of the order of the sub-step."""
        return stribeck_step(self.constants, position_m, velocity_m_s, command, disturbance)


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
