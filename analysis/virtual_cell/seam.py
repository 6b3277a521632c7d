"""The true seam of the virtual workpiece: a quintic B-spline x = f(y) in the table frame, mm."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline

Floats = NDArray[np.float64]

WELD_LENGTH_MM = 200.0
"""Length along y; arc on at y = 0."""
MARGIN_MM = 25.0
"""The seam goes on beyond both ends of the weld."""
_ORDINATES_MM = (0.0, 0.0, 0.0, 3.5, 9.5, 10.5, 4.0, -6.5, -11.0, -8.0, -2.5, -1.0, -1.0, -1.0)
_DEGREE = 5


class TrueSeam:
    """Position, slope and arc length of the seam; `rng` varies its shape a little."""

    def __init__(self, rng: np.random.Generator) -> None:
        ordinates = np.array(_ORDINATES_MM)
        ordinates[3:-3] += rng.uniform(-0.7, 0.7, len(ordinates) - 6)
        inner = np.linspace(-MARGIN_MM, WELD_LENGTH_MM + MARGIN_MM, len(ordinates) - _DEGREE + 1)
        knots = np.concatenate([[inner[0]] * _DEGREE, inner, [inner[-1]] * _DEGREE])
        self._spline = BSpline(knots, ordinates, _DEGREE)
        self._slope = self._spline.derivative()
        self._y_mm = np.linspace(inner[0], inner[-1], 2001)
        rate = np.hypot(1.0, self.slope(self._y_mm))
        steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(self._y_mm)
        length = np.concatenate([[0.0], np.cumsum(steps)])
        self._s_mm = length - np.interp(0.0, self._y_mm, length)

    def x_mm(self, y_mm: ArrayLike) -> Floats:
        """Table coordinate of the seam; constant beyond its ends."""
        inside = np.clip(y_mm, self._y_mm[0], self._y_mm[-1])
        return np.asarray(self._spline(inside), dtype=np.float64)

    def slope(self, y_mm: ArrayLike) -> Floats:
        """dx/dy."""
        inside = np.clip(y_mm, self._y_mm[0], self._y_mm[-1])
        return np.asarray(self._slope(inside), dtype=np.float64)

    def s_mm(self, y_mm: ArrayLike) -> Floats:
        """Arc length from y = 0."""
        return np.asarray(np.interp(np.asarray(y_mm), self._y_mm, self._s_mm), dtype=np.float64)

    def y_at(self, s_mm: ArrayLike) -> Floats:
        """The y at an arc length."""
        return np.asarray(np.interp(np.asarray(s_mm), self._s_mm, self._y_mm), dtype=np.float64)
