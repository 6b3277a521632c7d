"""Several photos of one bead along its path: how they overlap, and one measurement out of all.

Marks that both photos show tell how they lie to each other. Where there are too few, the width
does: it goes up and down alike on the common stretch. How surely is counted in independent
stretches, so that a short chance likeness is no overlap.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from seamlog.calibration import projected
from seamlog.errors import EvidenceError

from .image import Photo, make_photo
from .measurement import BeadMeasurement
from .overlap import REACH_PX, match_photos

Floats = NDArray[np.float64]

_STEP_MM = 0.25
_LEAST_SCORE = 5.0
_RIVAL = 0.75
_LEAST_OVERLAP_MM = 8.0
_SCALE_APART = 0.05
_FEWEST_STATIONS = 12
_COURSE_MM = 4.0
_TILE_PX = 2000


@dataclass(frozen=True, slots=True)
class Overlap:
    """`s` of the second photo x `scale` + `shift` = `s` of the first; lengths in the first's unit.

    `backwards` if the second runs against the first; `method` says what told it. `scale` has the
    standard uncertainty `u_scale`; millimetres need none of both.
    """

    shift: float
    backwards: bool
    method: str
    scale: float = 1.0
    u_scale: float = 0.0


@dataclass(frozen=True, slots=True)
class Stitched:
    """One measurement out of several photos, in px of `photo`, where they stand side by side.

    `first_station` and `shift`, in the measurement's unit, are those of each photo of `order`
    (indices as given).
    """

    measurement: BeadMeasurement
    photo: Photo
    order: tuple[int, ...]
    first_station: tuple[int, ...]
    shift: tuple[float, ...]


def backwards(m: BeadMeasurement) -> BeadMeasurement:
    """The same measurement run through from its other end; left and right change places."""
    ends = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}
    return replace(
        m,
        s=m.s[-1] - m.s[::-1],
        width=m.width[::-1],
        u_width=m.u_width[::-1],
        u_noise=m.u_noise[::-1],
        left_px=m.right_px[::-1],
        right_px=m.left_px[::-1],
        centre_px=m.centre_px[::-1],
        flagged=m.flagged[::-1],
        reason=tuple(reversed(m.reason)),
        open_start=m.open_stop,
        open_stop=m.open_start,
        starts_at=ends.get(m.starts_at, m.starts_at),
    )


def find_overlap(
    first: BeadMeasurement, second: BeadMeasurement, photos: tuple[Photo, Photo]
) -> Overlap:
    """How two photos of one bead overlap; `EvidenceError` where that cannot be told."""
    if first.unit != second.unit:
        raise EvidenceError("one has a calibration, the other has none: there is no common scale")
    if first.unit == "px" and not (first.trusted and second.trusted):
        raise EvidenceError("without calibration only beads that can be trusted are stitched")
    matrix = match_photos(photos[1], photos[0])
    seen = _by_marks(first, second, matrix) if matrix is not None else None
    if seen is None and first.unit == "px":
        raise EvidenceError(
            "without calibration only marks that both photos show tell how they overlap, and there "
            "are too few; let the photos overlap by several bead widths, or calibrate"
        )
    return seen or _by_width(first, second)


def _by_marks(
    first: BeadMeasurement, second: BeadMeasurement, matrix: NDArray[np.float64]
) -> Overlap | None:
    """From the second's stations that lie on the first's path; None where they do not."""
    moved = projected(matrix, second.centre_px)
    away, nearest = (np.asarray(found) for found in cKDTree(first.centre_px).query(moved))
    width_px = float(np.nanmedian(first.width)) / first.unit_per_px
    inside = (nearest > 0) & (nearest < len(first.s) - 1)
    on = inside & (away < 0.25 * width_px)
    if on.sum() < _FEWEST_STATIONS or on.sum() < 0.5 * inside.sum():
        return None
    rising = float(np.polyfit(second.s[on], first.s[nearest[on]], 1)[0])
    scale, u_scale = 1.0, 0.0
    if first.unit == "px":
        # Marks agree within REACH_PX, and the stretch of bead between them tells the scale.
        scale, u_scale = abs(rising), REACH_PX / np.sqrt(3) / float(np.ptp(first.s[nearest[on]]))
    elif abs(abs(rising) - 1) > _SCALE_APART:
        return None
    turned = rising < 0
    own = scale * (second.s[-1] - second.s if turned else second.s)
    shift = float(np.median(first.s[nearest[on]] - own[on]))
    return Overlap(shift, turned, "marks on both photos", scale, u_scale)


def _by_width(first: BeadMeasurement, second: BeadMeasurement) -> Overlap:
    turned = [False] if second.direction_known and first.direction_known else [False, True]
    trials = [
        (score, shift, flip)
        for flip in turned
        for score, shift in _scores(first, backwards(second) if flip else second)
    ]
    best = max(trials, default=(0.0, 0.0, False))
    apart = float(np.nanmedian(first.width))
    others = [t[0] for t in trials if t[2] != best[2] or abs(t[1] - best[1]) > apart]
    rival = max(others, default=0.0)
    if best[0] < _LEAST_SCORE or rival > _RIVAL * best[0]:
        raise EvidenceError(
            f"no stretch is surely the same on both photos (likeness of the width "
            f"{best[0]:.1f} standard deviations, next best {rival:.1f}); let the photos overlap by "
            "several bead widths"
        )
    return Overlap(best[1], best[2], "the width on both photos")


def _profile(m: BeadMeasurement) -> Floats:
    """Width, and how far the path lies off its own smooth course, on even steps; shape (n, 2).

    NaN where there is no trusted width.
    """
    s = np.arange(0.0, m.s[-1] + 1e-9, _STEP_MM)
    width = np.interp(s, m.s, np.where(m.good, m.width, np.nan))
    path = np.column_stack([np.interp(s, m.s, m.centre_px[:, k]) for k in range(2)])
    course = gaussian_filter1d(path, _COURSE_MM / _STEP_MM, axis=0, mode="nearest")
    heading = np.gradient(course, axis=0)
    heading /= np.maximum(np.hypot(*heading.T), 1e-9)[:, None]
    off = path - course
    aside = (heading[:, 0] * off[:, 1] - heading[:, 1] * off[:, 0]) * m.unit_per_px
    end = round(2 * _COURSE_MM / _STEP_MM)
    aside[:end] = aside[len(aside) - end :] = np.nan
    return np.column_stack([width, aside])


def _scores(first: BeadMeasurement, second: BeadMeasurement) -> list[tuple[float, float]]:
    """(score, shift mm) of every shift with enough overlap and widths of one size."""
    a, b = _profile(first), _profile(second)
    least = round(max(_LEAST_OVERLAP_MM, 1.5 * float(np.nanmedian(first.width))) / _STEP_MM)
    lengths = [_correlation_length(column) for column in a.T]
    found = []
    for shift in range(least - len(b), len(a) - least + 1):
        here = a[max(0, shift) : min(len(a), shift + len(b))]
        there = b[max(0, -shift) : max(0, -shift) + len(here)]
        if abs(np.nanmean(here[:, 0]) / np.nanmean(there[:, 0]) - 1) > _SCALE_APART:
            continue
        alike = [_likeness(*pair) for pair in zip(here.T, there.T, strict=True)]
        free = sum(count / length for (_, count), length in zip(alike, lengths, strict=True)) - 3
        weight = sum(count for _, count in alike)
        if alike[0][1] >= least and free > 0:
            r = sum(count * r for r, count in alike) / weight
            score = float(np.arctanh(np.clip(r, -0.9999, 0.9999)) * np.sqrt(free))
            found.append((score, _STEP_MM * shift))
    return found


def _likeness(here: Floats, there: Floats) -> tuple[float, int]:
    """Correlation where both are known, and in how many steps."""
    known = np.isfinite(here) & np.isfinite(there)
    if known.sum() < 3:
        return 0.0, 0
    x, y = here[known] - here[known].mean(), there[known] - there[known].mean()
    spread = float(np.sqrt((x @ x) * (y @ y)))
    return (float(x @ y) / spread if spread > 0 else 0.0), int(known.sum())


def _correlation_length(values: Floats) -> float:
    """Steps per independent value: where the autocorrelation falls below a half."""
    known = values[np.isfinite(values)]
    if len(known) < 3:
        return 1.0
    away = known - known.mean()
    power = float(away @ away)
    for lag in range(1, len(away)):
        if power <= 0 or float(away[lag:] @ away[:-lag]) < 0.5 * power:
            return float(lag)
    return float(len(away))


def stitch(photos: Sequence[Photo], measured: Sequence[BeadMeasurement]) -> Stitched:
    """One bead out of photos in the order along it; `EvidenceError` where two do not overlap.

    Where photos overlap, stations come from the photo whose end is further away.
    """
    turned, shifts = [measured[0]], [0.0]
    for number, following in enumerate(measured[1:], 2):
        pair = (photos[number - 2], photos[number - 1])
        try:
            overlap = find_overlap(turned[-1], following, pair)
        except EvidenceError as error:
            raise EvidenceError(f"photos {number - 1} and {number}: {error}") from error
        scaled = _scaled(following, overlap.scale, overlap.u_scale)
        turned.append(backwards(scaled) if overlap.backwards else scaled)
        shifts.append(shifts[-1] + overlap.shift)
    order = sorted(range(len(turned)), key=lambda k: (shifts[k], shifts[k] + turned[k].s[-1]))
    zero = shifts[order[0]]
    spans = [(shifts[k] - zero, shifts[k] - zero + float(turned[k].s[-1])) for k in order]
    picked = _picked([turned[k] for k in order], spans)
    picture, places = _side_by_side([photos[k] for k in order])
    parts = [
        _moved(turned[k], chosen, span[0], place)
        for k, chosen, span, place in zip(order, picked, spans, places, strict=True)
    ]
    firsts = np.concatenate([[0], np.cumsum([len(part.s) for part in parts])[:-1]])
    return Stitched(
        _joined(parts),
        picture,
        tuple(order),
        tuple(int(first) for first in firsts),
        tuple(span[0] for span in spans),
    )


def _scaled(m: BeadMeasurement, scale: float, u_scale: float) -> BeadMeasurement:
    """The measurement in a unit of which its own is `scale`."""
    return replace(
        m,
        s=scale * m.s,
        width=scale * m.width,
        u_width=np.hypot(scale * m.u_width, u_scale * m.width),
        u_noise=scale * m.u_noise,
        unit_per_px=scale * m.unit_per_px,
    )


def _picked(
    measured: Sequence[BeadMeasurement], spans: Sequence[tuple[float, float]]
) -> list[NDArray[np.bool_]]:
    """Stations of each photo that are taken: cut in the middle of each overlap."""
    chosen = []
    low = -np.inf
    for number, (m, (start, stop)) in enumerate(zip(measured, spans, strict=True)):
        following = spans[number + 1][0] if number + 1 < len(spans) else None
        high = np.inf if following is None else max((following + stop) / 2, low)
        place = m.s + start
        chosen.append((place >= low) & (place < high))
        low = max(low, high)
    return chosen


def _side_by_side(photos: Sequence[Photo]) -> tuple[Photo, list[tuple[float, float]]]:
    """Photos below each other, reduced alike; scale and top edge of each."""
    longest = max(max(photo.width_px, photo.height_px) for photo in photos)
    factor = min(1.0, _TILE_PX / longest)
    tiles = []
    for photo in photos:
        tile = photo.as_bgr8()
        if factor < 1:
            reduced = cv2.resize(tile, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            tile = np.asarray(reduced, dtype=np.uint8)
        tiles.append(tile)
    wide = max(tile.shape[1] for tile in tiles)
    padded = [np.pad(tile, ((0, 0), (0, wide - tile.shape[1]), (0, 0))) for tile in tiles]
    tops = np.concatenate([[0], np.cumsum([tile.shape[0] for tile in tiles])[:-1]])
    name = f"{len(photos)} photos, {photos[0].name.rsplit('/', 1)[-1]} and following"
    return make_photo(np.vstack(padded), name), [(factor, float(top)) for top in tops]


def _moved(
    m: BeadMeasurement, chosen: NDArray[np.bool_], shift: float, place: tuple[float, float]
) -> BeadMeasurement:
    factor, top = place

    def over(px: Floats) -> Floats:
        return np.asarray((px[chosen] + 0.5) * factor - 0.5 + (0.0, top))

    return replace(
        m,
        s=m.s[chosen] + shift,
        width=m.width[chosen],
        u_width=m.u_width[chosen],
        u_noise=m.u_noise[chosen],
        left_px=over(m.left_px),
        right_px=over(m.right_px),
        centre_px=over(m.centre_px),
        flagged=m.flagged[chosen],
        reason=tuple(np.array(m.reason, dtype=object)[chosen]),
        unit_per_px=m.unit_per_px / factor,
    )


def _joined(parts: Sequence[BeadMeasurement]) -> BeadMeasurement:
    return replace(
        parts[0],
        s=np.concatenate([part.s for part in parts]),
        width=np.concatenate([part.width for part in parts]),
        u_width=np.concatenate([part.u_width for part in parts]),
        u_noise=np.concatenate([part.u_noise for part in parts]),
        left_px=np.concatenate([part.left_px for part in parts]),
        right_px=np.concatenate([part.right_px for part in parts]),
        centre_px=np.concatenate([part.centre_px for part in parts]),
        flagged=np.concatenate([part.flagged for part in parts]),
        reason=tuple(reason for part in parts for reason in part.reason),
        confidence=min(part.confidence for part in parts),
        warnings=tuple(dict.fromkeys(text for part in parts for text in part.warnings)),
        direction_known=any(part.direction_known for part in parts),
        open_stop=parts[-1].open_stop,
    )
