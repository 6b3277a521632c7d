"""The axis without its dry friction: exact motion over a period, and eq. 1 from a datasheet.

    a dv/dt = command - disturbance - offset - b v - F(v)

The plants in `coulomb_plant` and `stribeck_plant` add F, set-valued at rest. Commands and
disturbances are in the axis' command unit, positions in m, velocities in m/s.
"""

import math
from dataclasses import replace

from seamlog.contracts import Axis

from .deterministic import exponential


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
    travel = period_s * mean_decay(exponent)
    travel_gain = period_s * period_s * mean_travel(exponent) / axis.inertia
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


def mean_decay(exponent: float) -> float:
    """(1 - exp(-z)) / z, 1 at z = 0."""
    if exponent > 1.0:
        return (1.0 - exponential(-exponent)) / exponent
    return _decay_series(exponent, 1)


def mean_travel(exponent: float) -> float:
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
