"""The centreline: a B-spline through path points, walked at even arc length."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_lsq_spline

from .plane import Points

Floats = NDArray[np.float64]

_DEGREE = 5
"""A stiff curve follows a seam's bends and not the unevenness of its toes."""
_FINE = 100
"""Chords per knot spacing that are as long as the curve."""
_ENOUGH = 60
"""Points from which on a curve is that stiff; fewer do not tie it down."""


@dataclass(frozen=True, slots=True)
class Centreline:
    """Places at even arc length: `s` (n,), `points` (n, 2), unit `normals` (n, 2), one unit.

    The normal is the direction of travel turned from x towards y.
    """

    s: Floats
    points: Points
    normals: Points

    def shifted(self, offset: Floats) -> Points:
        """Places moved along their normals by `offset` (n,)."""
        return np.asarray(self.points + offset[:, None] * self.normals)

    def every(self, count: int) -> "Centreline":
        """Each `count`-th place, the first in the middle of the first `count`."""
        pick = slice(count // 2, None, count)
        return Centreline(self.s[pick], self.points[pick], self.normals[pick])


def arc_length(points: Points) -> Floats:
    """Length along a polyline from its first point."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def fit_centreline(path: Points, step: float, knot_spacing: float) -> Centreline:
    """Least-squares B-spline through `path` (n, 2), n >= 2, with a knot every `knot_spacing`.

    Where points are missing there are fewer knots.
    """
    length = arc_length(path)
    keep = np.concatenate([[True], np.diff(length) > 1e-9])
    path, length = path[keep], length[keep]
    curve = _spline(path, length, knot_spacing)
    pace = max(step, knot_spacing / _FINE)
    dense = np.linspace(0.0, length[-1], max(64, int(length[-1] / pace)))
    walked = arc_length(curve(dense))
    s = np.arange(0.0, walked[-1] + 1e-9, step)
    points = np.asarray(curve(np.interp(s, walked, dense)))
    along_x, along_y = np.gradient(points, axis=0).T
    normals = np.column_stack([-along_y, along_x]) / np.hypot(along_x, along_y)[:, None]
    return Centreline(s, points, normals)


def _spline(path: Points, length: Floats, knot_spacing: float) -> BSpline:
    if len(path) < 8:
        path = np.column_stack(
            [np.interp(np.linspace(0, length[-1], 16), length, column) for column in path.T]
        )
        length = np.linspace(0, length[-1], 16)
    degree = _DEGREE if len(path) >= _ENOUGH else 3
    inner = max(0, min(int(length[-1] / knot_spacing) - 1, len(path) // 6))
    places = np.interp(np.linspace(0, len(path) - 1, inner + 2), np.arange(len(path)), length)
    knots = np.concatenate([[0.0] * degree, places, [length[-1]] * degree])
    return make_lsq_spline(length, path, knots, k=degree)
