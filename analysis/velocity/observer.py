"""Velocity by an extended state observer: position, speed and the total acceleration as states.

All three poles of the discrete observer lie at exp(-w T) (Gao, American Control Conference 2003).
"""

import math

import numpy as np

from .difference import FloatArray


class ExtendedStateObserver:
    """Causal and in plain arithmetic; `bandwidth_1_s` is w."""

    def __init__(self, bandwidth_1_s: float, period_s: float, position_m: float = 0.0) -> None:
        pole = math.exp(-bandwidth_1_s * period_s)
        self._period_s = period_s
        self._gains = (
            1.0 - pole**3,
            1.5 * (1.0 - pole) ** 2 * (1.0 + pole) / period_s,
            (1.0 - pole) ** 3 / period_s**2,
        )
        self._predicted = (position_m, 0.0, 0.0)

    def update(self, position_m: float) -> tuple[float, float, float]:
        """Position, speed and acceleration after this measurement."""
        t, (x, v, a) = self._period_s, self._predicted
        error = position_m - x
        x, v, a = (value + gain * error for value, gain in zip((x, v, a), self._gains, strict=True))
        self._predicted = (x + t * (v + 0.5 * t * a), v + t * a, a)
        return x, v, a


def observer_velocity(
    position_m: FloatArray, period_s: float, bandwidth_1_s: float = 40.0
) -> FloatArray:
    """Velocity of a whole record by the observer, shape (n,)."""
    observer = ExtendedStateObserver(bandwidth_1_s, period_s, float(position_m[0]))
    return np.array([observer.update(value)[1] for value in position_m.tolist()])
