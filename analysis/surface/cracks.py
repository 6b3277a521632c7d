"""Thin dark lines in a straightened bead: what a crack looks like from above.

Means along short straight lines in all directions make a thin line stand out of the noise. Both
its sides must be brighter. Ripples are dark lines too, but they come again and again: a response
counts against what its direction usually has at this place across the bead, and where a bead is
full of lines only those that stand out of them count.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from .blobs import Grid
from .straightened import StraightBead

_DIRECTIONS = 12
_LINE = 0.22
"""Length of the lines in widths of the bead."""
_BREADTH = 0.012
"""Breadth of a line (Gaussian sigma) in widths."""
_LEAST_PX = 0.8
_BESIDE = 2.6
"""Distance of the sides in breadths."""
_NINTH_DECILE = 1.2816
"""Of a normal distribution, in standard deviations."""
_FLOOR = 1.0
"""Grey levels of response that count as usual anywhere."""
_SEEN, _STRIKING = 3.5, 6.0
"""Scatters from which on a place belongs to a line, and from which on the line counts."""
_MANY = 8
"""Lines from which on they are a habit of this bead: streaks, folds, the rims of slag."""
_ABOVE_HABIT = 2.0
"""How far a line must then stand above the median of them."""
_SHORTEST = 0.3
"""Length of the shortest line in widths."""
_ROUND = 0.6
"""Response across a line, of that along it, up to which it is a line and no pore."""


def find_cracks(bead: StraightBead) -> list[tuple[float, float, float]]:
    """Row and column of each line's middle in the straightened bead, and its score in scatters."""
    length = max(7.0, _LINE * bead.width)
    breadth = max(_LEAST_PX, _BREADTH * bead.width)
    angles = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    dark = np.stack([_darkness(bead, angle, length, breadth) for angle in angles])
    against = dark / _usual(dark, bead.inside)
    best = np.argmax(against, axis=0)
    score = np.take_along_axis(against, best[None], axis=0)[0]
    across = (best + _DIRECTIONS // 2) % _DIRECTIONS
    along, aside = (np.take_along_axis(dark, at[None], axis=0)[0] for at in (best, across))
    line = (score > _SEEN) & (aside < _ROUND * along) & bead.inside
    found = _lines(line, score, _SHORTEST * bead.width)
    peaks = [peak for _, _, peak in found]
    habit = float(np.median(peaks)) if len(peaks) >= _MANY else 0.0
    return [each for each in found if each[2] > max(_STRIKING, _ABOVE_HABIT * habit)]


def _lines(
    line: NDArray[np.bool_], score: Grid, shortest: float
) -> list[tuple[float, float, float]]:
    """Middle (row, column) and highest score of each connected piece that is long enough."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(line.astype(np.uint8))
    found = []
    for piece in range(1, count):
        left, top, wide, high = (int(value) for value in stats[piece, :4])
        if np.hypot(wide, high) >= shortest:
            window = np.s_[top : top + high, left : left + wide]
            here = labels[window] == piece
            rows, columns = np.nonzero(here)
            peak = float(score[window][here].max())
            found.append((rows.mean() + top, columns.mean() + left, peak))
    return found


def _darkness(bead: StraightBead, angle: float, length: float, breadth: float) -> Grid:
    """How much darker lines in one direction are than the less bright one of their sides."""
    mean: Grid = np.asarray(
        cv2.filter2D(bead.light, cv2.CV_32F, _kernel(angle, length, breadth)), dtype=np.float32
    )
    move = _BESIDE * breadth * np.array([-np.sin(angle), np.cos(angle)])
    sides = [_moved(mean, sign * move) for sign in (-1, 1)]
    return np.asarray(np.maximum(np.minimum(*sides) - mean, 0) * bead.inside, dtype=np.float32)


def _kernel(angle: float, length: float, breadth: float) -> Grid:
    reach = int(np.ceil(length / 2 + 3 * breadth))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    along = x * np.cos(angle) + y * np.sin(angle)
    across = y * np.cos(angle) - x * np.sin(angle)
    weight = np.exp(-0.5 * (across / breadth) ** 2) * (np.abs(along) <= length / 2)
    return np.asarray(weight / weight.sum(), dtype=np.float32)


def _moved(values: Grid, by: NDArray[np.float64]) -> Grid:
    """`values` at places moved by (x, y)."""
    matrix = np.array([[1.0, 0.0, by[0]], [0.0, 1.0, by[1]]])
    size = (values.shape[1], values.shape[0])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(values, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    )


def _usual(dark: Grid, inside: NDArray[np.bool_]) -> Grid:
    """Scatter of each direction's response along the bead, per column, smoothed across.

    By its ninth decile: of ripples a half is dark, of a crack's column less than a tenth is crack.
    """
    known = np.where(inside[None], dark, np.nan)
    some = inside.any(axis=0)
    usual = np.zeros((len(dark), 1, dark.shape[2]), dtype=np.float32)
    usual[:, 0, some] = np.nanpercentile(known[:, :, some], 90, axis=1) / _NINTH_DECILE
    calm = np.stack([cv2.GaussianBlur(each, (0, 0), 2.0) for each in usual])
    return np.asarray(np.maximum(calm, _FLOOR), dtype=np.float32)
