"""The strip method: straighten the bead, find its toes, recentre, repeat, refine below a pixel."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError, ImageError

from .confidence import may_be_tint, soft_px
from .core import band_inside, flank_texture, softness
from .curve import Centreline, arc_length, fit_centreline
from .features import strip_features
from .given_path import BandPath, given_paths
from .image import Photo
from .measurement import TOES, BeadMeasurement
from .path import find_paths
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
_ROWS_AVERAGED = 4.0
"""Rows in the longest averaging (Gaussian sigma) that are enough: neighbours tell the same."""
_PAST, _LOST = 2.0, 0.5
"""Half widths that a path is longer than the bead, as only past its end can be seen that it ends,
and that each tracing adds at the ends: a stiff curve loses as much when it is moved to the toes."""


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

    @property
    def blur_px(self) -> float:
        """Blur of the sharper toe."""
        return min(toe.blur_px for toe in self.toes)


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
        measured = _most_trusted(photo, plane, given_paths(photo, plane, prior), start, sparse)
    else:
        dense = _Tracing(40, 1, (0.45, 0.35, 0.25), beyond)
        measured = _most_trusted(photo, plane, _found_paths(photo, plane), start, dense)
    return replace(measured, toe_definition=TOES[toe])


def _most_trusted(
    photo: Photo, plane: Plane, paths: Sequence[BandPath], start: str | None, tracing: _Tracing
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
    photo: Photo, plane: Plane, found: BandPath, start: str | None, tracing: _Tracing
) -> BeadMeasurement:
    unit = plane.unit_per_px(plane.to_px(found.points))
    traced = _traced(photo, plane, found.points, found.half, unit, tracing)
    band = found.band
    if may_be_tint(band.inner, traced.blur_px, 2 * traced.half / unit):
        flank = flank_texture(photo, plane, traced.line, traced.toes, unit)
        sharper = _sharper_inside(photo, plane, traced, unit, tracing)
        band = replace(band, flank=flank, sharper=sharper)
    return assemble(photo, plane, traced.line, traced.toes, unit, band, start)


def _traced(
    photo: Photo, plane: Plane, points: Points, half: float, unit: float, tracing: _Tracing
) -> _Traced:
    _refuse_narrow(photo, 2 * half / unit)
    path, by = points, _PAST
    for freedom in tracing.freedoms:
        path, by = _extended(photo, plane, path, half, by), _LOST
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
    if traced.blur_px <= soft_px(2 * traced.half / unit):
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
    before, after = (more[photo.holds(plane.to_px(more))] for more in (before, after))
    return np.concatenate([before[::-1], path, after])


def _heading(path: Points, over: float) -> Points:
    """Unit direction of travel at the last point, taken over the last `over`."""
    length = arc_length(path)
    back = min(int(np.searchsorted(length, length[-1] - over)), len(path) - 2)
    away = path[-1] - path[back]
    return np.asarray(away / max(float(np.hypot(*away)), 1e-9))


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


def _found_paths(photo: Photo, plane: Plane) -> list[BandPath]:
    paths = []
    for coarse in find_paths(photo):
        half = float(np.median(coarse.half_width_px)) * plane.unit_per_px(coarse.centre_px)
        evidence = float(coarse.evidence.mean())
        band = BandEvidence(evidence, coarse.rival, coarse.inner, float(coarse.nested))
        paths.append(BandPath(plane.to_plane(coarse.centre_px), half, band))
    return paths


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
