"""The bead laid straight, without what is the same all along it: shading and a steady gleam."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from seamlog.analysis.bead.curve import Centreline, fit_centreline
from seamlog.analysis.bead.image import Photo, make_photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane
from seamlog.analysis.bead.sampling import Strip, sample_strip

from .blobs import Grid

Floats = NDArray[np.float64]

COLUMNS = 80
"""Columns from toe to toe; fewer where the photo has fewer pixels."""
_STIFF = 6.0
"""Widths between two knots of the line through the bead's middle."""
_USUAL = 1.5
"""Widths along the bead over which what is usual at a place across it is taken."""
_GLEAM = 0.25
"""Widths across that a gleam takes at most: the usual is what is beside it, so gaps in it are."""
_KNOWN = 0.3
"""Part of those rows that must be bead."""
_UNKNOWN = 1e9
_COARSE = 1.3
"""Px of the halved photo to a step from which on its noise is averaged away first."""
_MARGIN = 0.06
"""Part of the width beside each toe that is left out."""


@dataclass(frozen=True, slots=True)
class StraightBead:
    """`light`: grey levels above the usual at this place across, (rows, columns); `inside`: bead.

    A row is a place along the bead, `width` the bead's in columns.
    """

    light: Grid
    inside: NDArray[np.bool_]
    width: float
    _strip: Strip
    _plane: Plane

    def to_px(self, row: float, column: float) -> tuple[float, float]:
        """Place in the photo."""
        at = int(np.clip(round(row), 0, len(self._strip.line.s) - 1))
        offset = self._strip.offset(np.array([column]))
        line = self._strip.line
        place = line.points[at] + offset * line.normals[at]
        x, y = self._plane.to_px(place[None])[0]
        return float(x), float(y)


def straightened(photo: Photo, plane: Plane, bead: BeadMeasurement) -> StraightBead | None:
    """The bead of a photo; None where too little of it was measured."""
    known = np.isfinite(bead.width) & np.isfinite(bead.centre_px).all(axis=1)
    if known.sum() < 2:
        return None
    width = float(np.median(bead.width[known]))
    step = max(bead.unit_per_px, width / COLUMNS)
    path = plane.to_plane(bead.centre_px[known])
    line = fit_centreline(path, step, _STIFF * width)
    blur = step / bead.unit_per_px
    if blur > _COARSE * 2 ** np.floor(np.log2(blur)):
        photo = make_photo(cv2.GaussianBlur(photo.pixels, (0, 0), 0.4 * blur), photo.name)
    strip = sample_strip(photo, plane, line, 0.75 * width, step, blur=blur)
    light = np.ascontiguousarray(strip.opponent[..., 0])
    inside = _between_toes(strip, plane, bead, known, path, line) & strip.valid
    columns = width / step
    usual = _usual(np.where(inside, light, np.nan), round(_USUAL * columns))
    broad = round(_GLEAM * columns)
    level = cv2.morphologyEx(usual, cv2.MORPH_OPEN, np.ones((1, max(1, broad)), np.uint8))
    inside &= level < _UNKNOWN
    above = np.where(inside, light - level, 0.0)
    scatter = 1.4826 * float(np.median(np.abs(above[inside]))) if inside.any() else 0.0
    residual = np.minimum(above, 2.0 * scatter + 1.0).astype(np.float32)
    return StraightBead(residual, inside, columns, strip, plane)


def _between_toes(
    strip: Strip,
    plane: Plane,
    bead: BeadMeasurement,
    known: NDArray[np.bool_],
    path: Floats,
    line: Centreline,
) -> NDArray[np.bool_]:
    """Samples between the toes, less a margin."""
    rows = np.maximum.accumulate(cKDTree(line.points).query(path)[1])
    sides = []
    for toe in (bead.left_px[known], bead.right_px[known]):
        away = ((plane.to_plane(toe) - line.points[rows]) * line.normals[rows]).sum(axis=1)
        sides.append(np.interp(line.s, line.s[rows], away))
    low, high = np.minimum(*sides), np.maximum(*sides)
    margin = _MARGIN * float(np.median(high - low)) + strip.step
    across = strip.offsets[None]
    return np.asarray((across > (low + margin)[:, None]) & (across < (high - margin)[:, None]))


def _usual(light: Floats, window: int) -> Floats:
    """Median along the bead over `window` rows, per column; huge where it is not known near by."""
    rows, columns = light.shape
    half = max(1, min(window, rows) // 2)
    places = np.arange(half, max(rows - half, half) + 1, max(1, half // 2))
    found = np.full((len(places), columns), np.nan)
    for number, place in enumerate(places):
        part = light[max(0, place - half) : place + half]
        some = np.isfinite(part).mean(axis=0) > _KNOWN
        found[number, some] = np.nanmedian(part[:, some], axis=0)
    at = np.arange(rows)
    nearest = np.abs(at[:, None] - places).argmin(axis=1)
    usual = np.full(light.shape, _UNKNOWN)
    for column in range(columns):
        some = np.isfinite(found[:, column])
        if some.any():
            near = some[nearest]
            usual[near, column] = np.interp(at[near], places[some], found[some, column])
    return usual
