"""Coulomb and viscous friction, stepped exactly from event to event: scalar, one axis.

F is set-valued at rest: the table stays where it is while the force is within +-F_s.
"""

import math
from typing import NamedTuple

from seamlog.contracts import Axis

from .deterministic import log_one_plus
from .dynamics import backward_axis, held_motion, mean_decay, mean_travel

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
    position_m += start_m_s2 * time_s * time_s * mean_travel(exponent)
    return position_m, velocity_m_s + start_m_s2 * time_s * mean_decay(exponent)


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


def _log_slope(x: float) -> float:
    """log(1 + x) / x, 1 at x = 0."""
    return log_one_plus(x) / x if x != 0.0 else 1.0
