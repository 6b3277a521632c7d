"""Where the bead lies along a path that is known, and how broad it roughly is."""

from dataclasses import dataclass

import numpy as np

from seamlog.errors import EvidenceError

from .band import Band, BandSearch, relative
from .curve import arc_length, fit_centreline
from .features import smoothed, strip_features
from .image import Photo
from .path import NESTED
from .plane import Plane, Points
from .sampling import sample_strip
from .series import median
from .width import BandEvidence

_ASIDE = 0.03
"""How far beside the bead a given path may run, as a part of the columns looked at."""
_COLUMNS, _SECTIONS = 60, 48
"""Columns to each side of a given path, and sections, in which the band is looked for."""
_LONG = 0.25
"""Reach to each side, in lengths of a path that lies in the photo as a whole: beads are longer than
wide, and what is broader is the plate on its table."""
_AROUND = 8.0
"""Half widths to each side of a given path that show a band well."""
_AT_FRAME = 0.1
"""Part of a path's length beside the frame within which it may run out of the photo."""


@dataclass(frozen=True, slots=True)
class BandPath:
    """A path in the plane's unit with the bead's rough half width and how evident it was."""

    points: Points
    half: float
    band: BandEvidence


def given_paths(photo: Photo, plane: Plane, prior: Points) -> list[BandPath]:
    """Bands around a given path (n, 2) in the plane's unit, the most evident one first.

    One of a few columns only is looked for again from nearer. Raises `EvidenceError` where the
    path does not run through the photo or no band lies along it.
    """
    prior = _inside_photo(photo, plane, np.asarray(prior, dtype=np.float64))
    unit = plane.unit_per_px(plane.to_px(prior))
    length = float(arc_length(prior)[-1])
    longest = _LONG if _ends_inside(photo, plane, prior, _AT_FRAME * length) else 0.5
    reach = min(0.5 * min(photo.width_px, photo.height_px) * unit, longest * length)
    found = _bands_along(photo, plane, prior, reach, unit)
    nearer = _AROUND * found[0].half if found else reach / _AROUND
    if nearer < 0.5 * reach:
        found = _bands_along(photo, plane, prior, nearer, unit) or found
    if not found:
        raise EvidenceError(
            f"{photo.name}: no bead can be told from the plate along the given path; check that "
            "the photo and its calibration belong to this weld"
        )
    return found


def _bands_along(
    photo: Photo, plane: Plane, prior: Points, reach: float, unit: float
) -> list[BandPath]:
    """The band within `reach` of a path, and one in it that may be the bead instead.

    At a resolution at which the path's wander does not matter.
    """
    step = max(unit, reach / _COLUMNS)
    line = fit_centreline(prior, step, 6 * step)
    strip = sample_strip(photo, plane, line, reach, step, blur=step / unit)
    features = strip_features(strip.opponent, 1.5)
    every = max(2, -(-len(features) // _SECTIONS))
    sections = smoothed(features, 0, 0.7 * every)[every // 2 :: every]
    columns = features.shape[1]
    held = (columns / 2, _ASIDE * columns)
    search = BandSearch(sections, 3.0, 0.7 * columns, held=held)

    def along(band: Band, inner: float, nested: float) -> BandPath:
        rows = np.arange(band.first, band.last + 1) * every + every // 2
        points = strip.places(rows, band.middle - 0.5)
        half = median(band.right - band.left) / 2 * step
        return BandPath(points, half, BandEvidence(float(band.evidence.mean()), 0.0, inner, nested))

    band = search.best()
    if band is None:
        return []
    inside = search.inside(band)
    inner = relative(inside, band)
    paths = [along(band, inner, 0.0)]
    if inside is not None and inner >= NESTED:
        paths.append(along(inside, relative(search.inside(inside), inside), 1.0))
    return paths


def _ends_inside(photo: Photo, plane: Plane, path: Points, margin: float) -> bool:
    """Whether both ends are `margin` away from the photo's frame."""
    ends = plane.to_px(path[[0, -1]])
    away = margin / plane.unit_per_px(ends)
    return bool(photo.holds(ends - away).all() and photo.holds(ends + away).all())


def _inside_photo(photo: Photo, plane: Plane, prior: Points) -> Points:
    inside = photo.holds(plane.to_px(prior))
    if inside.sum() < 2:
        raise EvidenceError(
            f"{photo.name}: the given path does not run through the photo; check the calibration"
        )
    return prior[inside]
