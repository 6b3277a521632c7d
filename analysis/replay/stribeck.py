"""Friction at low speed, from the record itself.

Dry friction that grows towards rest decides what a slow weld does under another controller. Over
the periods in which the axis slides, force along the motion is fitted by C + dF exp(-|v| / v_s);
dF is taken over if it is known well enough, else the axis stays with Coulomb friction.
"""

from dataclasses import replace

import numpy as np

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.contracts import Axis

from .sliding import sliding_force

_SPEEDS_M_S = (0.0005, 0.001, 0.0015, 0.002, 0.003, 0.005, 0.008, 0.012)
_LEAST_ROWS = 100
_LEAST_DEVIATIONS = 4.0
_LARGEST_EXCESS = 1.0
"""dF beyond this share of C is taken for something else than friction."""


def with_stribeck(record: AxisRecord, axis: Axis) -> Axis:
    """`axis` with static friction and Stribeck speed where the record shows them."""
    sliding = sliding_force(record, axis)
    speed = np.abs(sliding.velocity_m_s[sliding.rows])
    along = (np.sign(sliding.velocity_m_s) * sliding.force)[sliding.rows]
    if len(speed) < _LEAST_ROWS:
        return axis
    best = min(_SPEEDS_M_S, key=lambda stribeck: _fit(speed, along, stribeck)[0])
    _, excess, deviation = _fit(speed, along, best)
    if excess < _LEAST_DEVIATIONS * deviation or excess > _LARGEST_EXCESS * axis.coulomb_friction:
        return axis
    return replace(axis, static_friction=axis.coulomb_friction + excess, stribeck_speed_m_s=best)


def _fit(
    speed: FloatArray,
    along: FloatArray,
    stribeck_m_s: float,
) -> tuple[float, float, float]:
    """Sum of squares, dF and its standard deviation."""
    regressor = np.column_stack([np.ones_like(speed), np.exp(-speed / stribeck_m_s)])
    values = np.linalg.lstsq(regressor, along, rcond=None)[0]
    squares = float(np.sum((along - regressor @ values) ** 2))
    covariance = np.linalg.pinv(regressor.T @ regressor) * squares / max(1, len(speed) - 2)
    return squares, float(values[1]), float(np.sqrt(covariance[1, 1]))
