"""Friction of the ball-screw axis: the set-valued law of the plant, the shape of the controller."""

import math

from seamlog.contracts import Axis

from .deterministic import arctangent, exponential, log_one_plus

_TWO_OVER_PI = 0.6366197723675814
_THIRD = 0.3333333333333333


def friction_shape(velocity_m_s: float, dead_zone_m_s: float, power: int = 9) -> float:
    """Eq. 3 without C and b: (2/pi) atan((v/alpha)^power), dimensionless, in (-1, 1).

    `power` is odd. Far outside the dead zone the series of the arctangent at infinity is exact.
    """
    ratio = velocity_m_s / dead_zone_m_s
    if power == 9:
        cube = ratio * ratio * ratio
        raised = cube * cube * cube
    else:
        raised = ratio
        for _ in range(power // 2):
            raised *= ratio * ratio
    if raised > 1e4:
        rest = 1.0 / raised
        return 1.0 - _TWO_OVER_PI * (rest - rest * rest * rest * _THIRD)
    if raised < -1e4:
        rest = 1.0 / raised
        return -1.0 - _TWO_OVER_PI * (rest - rest * rest * rest * _THIRD)
    return _TWO_OVER_PI * arctangent(raised)


def arctangent_sign(velocity: float) -> float:
    """Eq. 17 without C: (2/pi) atan(1e6 v), whose width depends on the unit of `velocity`."""
    return _TWO_OVER_PI * arctangent(1e6 * velocity)


def sliding_friction(axis: Axis, speed_m_s: float) -> float:
    """Eq. 2 without the viscous part, at `speed_m_s` >= 0, in the axis' command unit."""
    if axis.stribeck_speed_m_s <= 0.0:
        return axis.coulomb_friction
    rise = stribeck_rise(speed_m_s / axis.stribeck_speed_m_s, axis.stribeck_power)
    excess = max(axis.static_friction, axis.coulomb_friction) - axis.coulomb_friction
    return axis.coulomb_friction + excess * rise


def stribeck_rise(ratio: float, power: float) -> float:
    """Share of the rise towards rest that is left at `ratio` >= 0 Stribeck speeds."""
    if ratio > 1e3:
        return 0.0
    if power == 2.0:
        ratio = ratio * ratio
    elif power != 1.0 and ratio > 0.0:
        ratio = exponential(power * log_one_plus(ratio - 1.0))
    return exponential(-ratio)


def smallest_dead_zone_m_s(axis: Axis) -> float:
    """Eq. 5: the alpha below which the friction shape overtakes the Stribeck curve, m/s.

    rho(delta) v_s, where rho is the largest r tan(pi/2 exp(-r^delta))^(1/9): the shape must stay
    below 1 - exp(-r^delta) at every speed r v_s. 3.48 for delta = 1, 1.353 for delta = 2.
    """
    if axis.static_friction <= axis.coulomb_friction:
        return 0.0
    ratios = (0.01 * k for k in range(1, 2000))
    return axis.stribeck_speed_m_s * max(_overtaking(r, axis.stribeck_power) for r in ratios)


def _overtaking(ratio: float, power: float) -> float:
    return float(ratio * math.tan(0.5 * math.pi * math.exp(-(ratio**power))) ** (1.0 / 9.0))
