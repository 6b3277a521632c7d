"""The strip method: straighten the bead, find its toes, recentre, repeat, refine below a pixel."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError, ImageError

from .band import Band, BandSearch, relative
from .confidence import may_be_tint, soft_px
from .core import band_inside, flank_texture, softness
from .curve import Centreline, arc_length, fit_centreline
from .features import smoothed, strip_features
from .image import Photo
from .measurement import TOES, BeadMeasurement
from .path import NESTED, find_paths
from .plane import Plane, Points
from .refine import Rough, longest_px, refine_toes
from .sampling import Strip, sample_strip
from .series import calmed, median
from .toes import Extent, find_toes, strip_look
from .width import BandEvidence, Toes, assemble

Floats = NDArray[np.float64]


STATION_MM = 0.25
STATION_PX = 2.0
NARROWEST_PX = 8.0
_CLEAR = 0.5
"""Confidence from which on no other candidate is tried."""
_ENOUGH = 40
"""Stations from which on a band inside is looked for."""
_BEYOND = {"metal": 0.06, "outer": 0.25}
"""Half widths beside a toe, by its definition, that are neither bead nor plate at first."""
_ASIDE = 0.03
"""How far beside the bead a given path may run, as a part of the columns looked at."""
_ROWS_AVERAGED = 4.0
"""Rows in the longest averaging (Gaussian sigma) that are enough: neighbours tell the same."""
_PAST, _LOST = 2.0, 0.5
"""Half widths that a path is longer than the bead, as only past its end can be seen that it ends,
and that each tracing adds at the ends: a stiff curve loses as much when it is moved to the toes."""
_COLUMNS, _SECTIONS = 60, 48
"""Columns to each side of a given path, and sections, in which the band is looked for."""
_LONG = 0.25
"""Reach to each side, in lengths of a path that lies in the photo as a whole: beads are longer than
wide, and what is broader is the plate on its table."""
_AROUND = 8.0
"""Half widths to each side of a given path that show a band well."""


@dataclass(frozen=True, slots=True)
class _Path:
    """A path in the plane's unit with the bead's rough half width and how evident it was."""

    points: Points
    half: float
    band: BandEvidence


@dataclass(frozen=True, slots=True)
class _Tracing:
    """How coarse toes are traced: in one strip after the other, each recentred on the last.

    `columns` of half the bead, `stretch` rows : columns, `freedoms` around the last toes in half
    widths, and the half widths `beyond` a toe at which the plate's look begins.
    """

    columns: int
    stretch: int
    freedoms: tuple[float, ...]
    beyond: float


@dataclass(frozen=True, slots=True)
class _Traced:
    """Both toes at stations of a line through the bead's middle."""

    line: Centreline
    half: float
    toes: tuple[Toes, Toes]


def measure_strip(
    photo: Photo,
    plane: Plane,
    prior: Points | None = None,
    start: str | None = None,
    toe: str = "metal",
) -> BeadMeasurement:
    """Measure bead width at stations along the bead; see `BeadDetector`.

    `prior` is a path in the plane's unit that lies in the bead, (n, 2), n >= 2. Raises
    `EvidenceError` where no bead can be told from the plate and `ImageError` for one narrower
    than 8 px.
    """
    beyond = _BEYOND[toe]
    if prior is not None:
        sparse = _Tracing(40, 6, (0.45,), beyond)
        measured = _most_trusted(photo, plane, _given_paths(photo, plane, prior), start, sparse)
    else:
        dense = _Tracing(40, 1, (0.45, 0.35, 0.25), beyond)
        measured = _most_trusted(photo, plane, _found_paths(photo, plane), start, dense)
    return replace(measured, toe_definition=TOES[toe])


def _most_trusted(
    photo: Photo, plane: Plane, paths: Sequence[_Path], start: str | None, tracing: _Tracing
) -> BeadMeasurement:
    """The first measurement that can be trusted, else the one with the least doubt."""
    best: BeadMeasurement | None = None
    refusal: Exception | None = None
    for path in paths:
        if path.band.nested and best is not None:
            path = replace(path, band=replace(path.band, nested=1 - best.tint))
        try:
            measured = _measure(photo, plane, path, start, tracing)
        except (EvidenceError, ImageError) as error:
            refusal = refusal or error
            continue
        if measured.confidence >= _CLEAR:
            return measured
        if best is None or measured.confidence > best.confidence:
            best = measured
    if best is None:
        assert refusal is not None
        raise refusal
    return best


def _measure(
    photo: Photo, plane: Plane, found: _Path, start: str | None, tracing: _Tracing
) -> BeadMeasurement:
    unit = plane.unit_per_px(plane.to_px(found.points))
    traced = _traced(photo, plane, found.points, found.half, unit, tracing)
    band = found.band
    blur_px = min(toe.blur_px for toe in traced.toes)
    if may_be_tint(band.inner, blur_px, 2 * traced.half / unit):
        flank = flank_texture(photo, plane, traced.line, traced.toes, unit)
        sharper = _sharper_inside(photo, plane, traced, unit, tracing)
        band = replace(band, flank=flank, sharper=sharper)
    return assemble(photo, plane, traced.line, traced.toes, unit, band, start)


def _traced(
    photo: Photo, plane: Plane, points: Points, half: float, unit: float, tracing: _Tracing
) -> _Traced:
    _refuse_narrow(photo, 2 * half / unit)
    path = points
    for freedom in tracing.freedoms:
        path = _extended(photo, plane, path, half, _PAST if path is points else _LOST)
        strip, extent = _straighten(photo, plane, path, half, unit, freedom, tracing)
        middle = _middle(strip, extent)
        path = strip.line.shifted(middle)
        half = median(extent.half) * strip.step
        _refuse_narrow(photo, 2 * half / unit)
    every, along = _row_step(plane, half, unit)
    line = fit_centreline(path, along, max(12.0 * half, 16 * unit))
    rough = _carried(strip, extent, middle, line)
    toes = refine_toes(photo, plane, line, rough, unit, every)
    return _Traced(line.every(every), rough.half, toes)


def _sharper_inside(
    photo: Photo, plane: Plane, traced: _Traced, unit: float, tracing: _Tracing
) -> float:
    """How many times sharper a band inside is than the toes, each at its weaker side."""
    if min(toe.blur_px for toe in traced.toes) <= soft_px(2 * traced.half / unit):
        return 0.0
    rows = np.flatnonzero(traced.toes[0].present > 0)
    if len(rows) < _ENOUGH:
        return 0.0
    middle = traced.line.shifted((traced.toes[0].offset + traced.toes[1].offset) / 2)[rows]
    found = band_inside(photo, plane, middle, traced.half, unit)
    if found is None:
        return 0.0
    try:
        inner = _traced(photo, plane, *found, unit, tracing)
    except (EvidenceError, ImageError):
        return 0.0
    inside = max(softness(photo, plane, inner.line, inner.toes, unit))
    return min(softness(photo, plane, traced.line, traced.toes, unit)) / max(inside, 1.0)


def _extended(photo: Photo, plane: Plane, path: Points, half: float, by: float) -> Points:
    """The path with `by` half widths more at both ends, as far as the photo goes."""
    beyond = np.arange(0.1, by + 0.01, 0.1)[:, None] * half
    before = path[0] + beyond * _heading(path[::-1], 3 * half)
    after = path[-1] + beyond * _heading(path, 3 * half)
    before, after = (more[_in_photo(photo, plane.to_px(more))] for more in (before, after))
    return np.concatenate([before[::-1], path, after])


def _heading(path: Points, over: float) -> Points:
    """Unit direction of travel at the last point, taken over the last `over`."""
    length = arc_length(path)
    back = min(int(np.searchsorted(length, length[-1] - over)), len(path) - 2)
    away = path[-1] - path[back]
    return np.asarray(away / max(float(np.hypot(*away)), 1e-9))


def _in_photo(photo: Photo, px: Points) -> NDArray[np.bool_]:
    inside = (px >= 0).all(axis=1) & (px <= (photo.width_px - 1, photo.height_px - 1)).all(axis=1)
    return np.asarray(inside)


def _refuse_narrow(photo: Photo, width_px: float) -> None:
    if width_px < NARROWEST_PX:
        raise ImageError(
            f"{photo.name}: the bead is {width_px:.1f} px across, too few to measure (at least "
            f"{NARROWEST_PX:g}, better 30); take the photo from nearer"
        )


def _row_step(plane: Plane, half: float, unit: float) -> tuple[int, float]:
    """Rows per station and their distance: a px, or more where the averaging takes many."""
    station = STATION_MM if plane.unit == "mm" else STATION_PX
    row = unit * max(1.0, longest_px(half / unit) / _ROWS_AVERAGED)
    count = max(1, int(np.ceil(station / row)))
    return count, station / count


def _found_paths(photo: Photo, plane: Plane) -> list[_Path]:
    paths = []
    for coarse in find_paths(photo):
        half = float(np.median(coarse.half_width_px)) * plane.unit_per_px(coarse.centre_px)
        evidence = float(coarse.evidence.mean())
        band = BandEvidence(evidence, coarse.rival, coarse.inner, float(coarse.nested))
        paths.append(_Path(plane.to_plane(coarse.centre_px), half, band))
    return paths


def _given_paths(photo: Photo, plane: Plane, prior: Points) -> list[_Path]:
    """Bands around a given path; one of a few columns only is looked for again from nearer."""
    prior = _inside_photo(photo, plane, np.asarray(prior, dtype=np.float64))
    unit = plane.unit_per_px(plane.to_px(prior))
    length = float(arc_length(prior)[-1])
    longest = _LONG if _ends_inside(photo, plane, prior, 0.1 * length) else 0.5
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
) -> list[_Path]:
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

    def along(band: Band, inner: float, nested: float) -> _Path:
        rows = np.arange(band.first, band.last + 1) * every + every // 2
        rows = rows.clip(0, len(line.s) - 1)
        middle = strip.offset((band.left + band.right) / 2 - 0.5)
        points = line.points[rows] + middle[:, None] * line.normals[rows]
        half = median(band.right - band.left) / 2 * step
        return _Path(points, half, BandEvidence(float(band.evidence.mean()), 0.0, inner, nested))

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
    return bool(_in_photo(photo, ends - away).all() and _in_photo(photo, ends + away).all())


def _inside_photo(photo: Photo, plane: Plane, prior: Points) -> Points:
    inside = _in_photo(photo, plane.to_px(prior))
    if inside.sum() < 2:
        raise EvidenceError(
            f"{photo.name}: the given path does not run through the photo; check the calibration"
        )
    return prior[inside]


def _middle(strip: Strip, extent: Extent) -> Floats:
    """The middle between the toes; where a toe is off the photo, the offset of the nearest row."""
    offsets = strip.offset(extent.middle)
    rows = np.arange(len(offsets))
    columns = strip.valid.shape[1] - 1
    seen = np.ones(len(rows), dtype=bool)
    for edge in (extent.left - 3, extent.right + 3):
        seen &= strip.valid[rows, np.clip(np.rint(edge).astype(int), 0, columns)]
    if seen.any():
        offsets = np.interp(rows, rows[seen], offsets[seen])
    return _running_median(offsets, strip, extent)


def _straighten(
    photo: Photo,
    plane: Plane,
    path: Points,
    half: float,
    unit: float,
    freedom: float,
    tracing: _Tracing,
) -> tuple[Strip, Extent]:
    """The toes in a strip reduced to the tracing."""
    step = max(unit, half / tracing.columns)
    strip = _sampled(photo, plane, path, half, unit, step * tracing.stretch, step)
    features = strip_features(strip.opponent, max(1.5, 0.03 * half / step))
    look = strip_look(features, strip.valid, 2.0 / tracing.stretch)
    middle = strip.column(np.zeros(len(strip.line.s)))
    rough = Extent(middle - half / step, middle + half / step, np.zeros(len(strip.line.s)))
    try:
        first = find_toes(look, rough, freedom, tracing.beyond)
        return strip, find_toes(look, _calmed(first, strip), 0.6 * freedom, tracing.beyond)
    except EvidenceError as error:
        raise EvidenceError(f"{photo.name}: {error}") from error


def _sampled(
    photo: Photo,
    plane: Plane,
    path: Points,
    half: float,
    unit: float,
    along: float,
    across: float,
) -> Strip:
    line = fit_centreline(path, along, max(12.0 * half, 16 * unit))
    return sample_strip(photo, plane, line, 2.4 * half + 8 * across, across, blur=across / unit)


def _carried(strip: Strip, extent: Extent, middle: Floats, line: Centreline) -> Rough:
    """The extent found in a strip as offsets at the rows of the line through its `middle`."""
    share = strip.line.s / strip.line.s[-1] * line.s[-1]

    def carried(values: Floats) -> Floats:
        return np.interp(line.s, share, values)

    left, right = (carried(strip.offset(edge) - middle) for edge in (extent.left, extent.right))
    return Rough(left, right, carried(extent.present))


def _calmed(extent: Extent, strip: Strip) -> Extent:
    return Extent(
        _running_median(extent.left, strip, extent),
        _running_median(extent.right, strip, extent),
        extent.present,
    )


def _running_median(values: Floats, strip: Strip, extent: Extent) -> Floats:
    """Calm over half a width along the strip."""
    from scipy.ndimage import median_filter

    row = float(strip.line.s[1] - strip.line.s[0])
    size = int(max(5, median(extent.half) * strip.step / row))
    calm = median_filter(values, 2 * (size // 2) + 1, mode="nearest")
    return calmed(calm, size / 4)
