"""The live loop's seam path: a quintic least-squares B-spline through the points seen so far."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_lsq_spline

Floats = NDArray[np.float64]

_DEGREE = 5
_KNOT_SPACING_MM = 22.0
_JUMP_MM = 1.0
_TUKEY = 4.685


class SeamPath:
    """Points in the table frame, mm, and the curve x(y) through them.

    A picture whose points lie off the curve by more than a millimetre in the median means that the
    plate has slipped: the older points are moved by as much.
    """

    def __init__(self) -> None:
        self._x_mm = np.empty(0)
        self._y_mm = np.empty(0)
        self._curve: tuple[BSpline, BSpline, BSpline] | None = None

    @property
    def is_known(self) -> bool:
        """Whether a curve has been fitted."""
        return self._curve is not None

    def add(self, x_mm: Floats, y_mm: Floats) -> None:
        """Take the points of one picture."""
        if self._curve is not None and len(x_mm) >= 5:
            slip_mm = float(np.median(x_mm - self._curve[0](self._inside(y_mm))))
            if abs(slip_mm) > _JUMP_MM:
                self._x_mm = self._x_mm + slip_mm
                self.fit()
        self._x_mm = np.concatenate([self._x_mm, x_mm])
        self._y_mm = np.concatenate([self._y_mm, y_mm])

    def fit(self) -> bool:
        """Fit anew, with Tukey weights; False where there are too few points."""
        order = np.argsort(self._y_mm, kind="stable")
        x, y = self._x_mm[order], self._y_mm[order]
        if len(y) < 60 or y[-1] - y[0] < 2 * _KNOT_SPACING_MM:
            return False
        spans = max(2, round((y[-1] - y[0]) / _KNOT_SPACING_MM))
        inner = np.linspace(y[0], y[-1], spans + 1)
        knots = np.concatenate([[y[0]] * _DEGREE, inner, [y[-1]] * _DEGREE])
        if np.any(np.diff(np.searchsorted(y, inner)) < 6):
            return False
        weights = np.ones_like(y)
        for _ in range(3):
            curve = make_lsq_spline(y, x, knots, _DEGREE, w=weights)
            residual = x - curve(y)
            scale = _TUKEY * max(1.4826 * float(np.median(np.abs(residual))), 1e-3)
            weights = np.clip(1.0 - (residual / scale) ** 2, 1e-3, None)
        self._curve = (curve, curve.derivative(), curve.derivative(2))
        return True

    def at(self, y_mm: float) -> tuple[float, float, float]:
        """x, dx/dy, d2x/dy2 at one place; straight on beyond the ends."""
        assert self._curve is not None
        inside = float(self._inside(np.array(y_mm)))
        curve, slope, bend = self._curve
        if inside != y_mm:
            return float(curve(inside)), 0.0, 0.0
        return float(curve(inside)), float(slope(inside)), float(bend(inside))

    def polyline(self) -> tuple[Floats, Floats]:
        """The curve at each millimetre, (x, y) in the table frame, mm."""
        assert self._curve is not None
        start, end = self._ends()
        y = np.linspace(start, end, round(end - start) + 1)
        return np.asarray(self._curve[0](y)), y

    def _ends(self) -> tuple[float, float]:
        assert self._curve is not None
        knots = self._curve[0].t
        return float(knots[0]), float(knots[-1])

    def _inside(self, y_mm: Floats) -> Floats:
        return np.asarray(np.clip(y_mm, *self._ends()))
