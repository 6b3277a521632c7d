"""Inside a band: what tells a bead from a heat tint around one.

Something sharp inside shows that the photo is in focus, so toes that are soft in it are soft in
truth: the fading end of a heat tint rather than the toes of a bead. And a tint is a film that
leaves the plate's surface as it was, where weld metal is mostly rougher.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from .band import BandSearch
from .curve import Centreline, fit_centreline
from .features import smoothed, strip_features
from .image import Photo, opponent
from .plane import Plane, Points
from .refine import averaged_at, columns_of_change
from .sampling import sample_rows, sample_strip
from .series import median
from .width import Toes
from .zones import fisher_direction

Floats = NDArray[np.float64]

_COLUMNS = 60
"""Columns of half the band in the strip that is searched."""
_INSIDE = 0.85
"""Part of the half width that is searched: the toes themselves lie outside."""
_MIDDLE = 0.3
"""Heat spreads alike to both sides: a bead lies this near (half widths) to its tint's middle."""
_ALONG = 3
"""Rows per section."""
_FLANK = np.linspace(0.15, 0.45, 7)
"""Half widths from a toe at which the surface on both its sides is looked at."""
_REACH = 0.018
"""Detail finer than this part of the width is texture."""
_ROUNDING = 0.5
"""Grey levels of detail that every surface has."""


def band_inside(
    photo: Photo, plane: Plane, middle: Points, half: float, unit: float
) -> tuple[Points, float] | None:
    """Path and half width of the most evident band well inside another, as if that were plate.

    `middle` (n, 2), `half` and `unit` (length of a px) are in the plane's unit.
    """
    step = max(unit, half / _COLUMNS)
    line = fit_centreline(middle, 2 * step, 4 * half)
    strip = sample_strip(photo, plane, line, _INSIDE * half, step, blur=step / unit)
    sections = smoothed(strip_features(strip.opponent, 2.0), 0, float(_ALONG))[::_ALONG]
    columns = sections.shape[1]
    central = np.abs(np.arange(columns + 1) - columns / 2) * step < _MIDDLE * half
    search = BandSearch(sections, 0.12 * columns, 0.65 * columns)
    band = search.best(central.astype(np.float32))
    if band is None:
        return None
    rows = np.arange(band.first, band.last + 1) * _ALONG
    points = strip.places(rows, band.middle - 0.5)
    return points, median(band.right - band.left) / 2 * step


def softness(
    photo: Photo, plane: Plane, line: Centreline, toes: tuple[Toes, Toes], unit: float
) -> tuple[float, float]:
    """Px that the change at each toe would take at its steepest: left, right.

    The median over the stations of `line`; a change without an end within a fifth of the half
    width counts as far as that.
    """
    half_px = median(toes[1].offset - toes[0].offset) / 2 / unit
    reach = int(max(6, 0.2 * half_px))
    sides = []
    for side, toe in ((-1, toes[0]), (1, toes[1])):
        step = -side * unit
        first = toe.offset - reach * step
        pixels, valid = sample_rows(photo, plane, line, first, step, 2 * reach + 1)
        smooth = averaged_at(pixels, np.arange(len(pixels)), 2.0)
        inside, outside = (
            smooth[:, part][valid[:, part]] for part in (slice(reach + 1, None), slice(0, reach))
        )
        direction = fisher_direction(inside, outside)[0].astype(np.float32)
        sides.append(columns_of_change(smooth @ direction))
    return sides[0], sides[1]


def flank_texture(
    photo: Photo, plane: Plane, line: Centreline, toes: tuple[Toes, Toes], unit: float
) -> float:
    """How many times more textured the surface is inside a toe than beyond it.

    Of both toes the greater; 0 for a toe beyond which no plate is in the photo.
    """
    width = median(toes[1].offset - toes[0].offset)
    reach_px = max(1.5, _REACH * width / unit)
    sides = [
        plane.to_px(
            np.concatenate([line.shifted(toe.offset + out * away) for away in _FLANK * width / 2])
        )
        for toe, inward in zip(toes, (1, -1), strict=True)
        for out in (inward, -inward)
    ]
    inside_left, beyond_left, inside_right, beyond_right = _detail(photo, sides, reach_px)
    pairs = ((inside_left, beyond_left), (inside_right, beyond_right))
    return max(inside / beyond if np.isfinite(beyond) else 0.0 for inside, beyond in pairs)


def _detail(photo: Photo, groups: Sequence[Points], reach_px: float) -> list[float]:
    """Typical detail finer than `reach_px` at each group of places; inf off the photo."""
    places = [np.rint(group).astype(np.int64) for group in groups]
    seen = [group[photo.holds(group)] for group in places]
    every = np.concatenate(seen)
    if not len(every):
        return [np.inf] * len(seen)
    margin = int(4 * reach_px) + 1
    left, top = np.maximum(every.min(axis=0) - margin, 0)
    right, bottom = every.max(axis=0) + margin
    grey = np.ascontiguousarray(opponent(photo.pixels[top:bottom, left:right])[..., 0])
    detail = np.abs(grey - cv2.GaussianBlur(grey, (0, 0), reach_px))
    return [
        median(detail[group[:, 1] - top, group[:, 0] - left]) + _ROUNDING if len(group) else np.inf
        for group in seen
    ]
