"""From two toes to widths: uncertainty per station, flags with their reason, confidence."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from seamlog.errors import EvidenceError

from .confidence import Doubt, Evidence, confidence, doubts, serious, tint
from .curve import Centreline
from .image import Photo
from .measurement import END, TRUSTED, BeadMeasurement
from .plane import Plane, Points
from .series import median

Floats = NDArray[np.float64]

_FAINT = 0.08
"""Noise of a toe, as a part of the width, above which a station is flagged."""
_REFUSED = 0.2
_ROUND_END = 0.5


@dataclass(frozen=True, slots=True)
class BandEvidence:
    """How evident the band was in the photo; see `confidence.Evidence`."""

    evidence: float
    rival: float
    inner: float
    nested: float
    sharper: float = 0.0
    flank: float = np.inf


@dataclass(frozen=True, slots=True)
class Toes:
    """One side's toes, a value per station: offset and its uncertainties in the plane's unit.

    `smeared` is the part of its own waviness that blur and averaging took, rms. `height` is the
    step from plate to bead (grey levels), `bare` that without the shading beside it, `within`
    whether an edge is where it was looked for, `in_frame` whether the plate beyond is in the photo,
    `present` how much the inside looks like bead, `disagreement` the distance between the sharpest
    edge and where the looks change. `distance` is how far bead and plate are apart at this toe, in
    standard deviations.
    """

    offset: Floats
    u_noise: Floats
    u_model: Floats
    smeared: float
    height: Floats
    bare: Floats
    within: NDArray[np.bool_]
    in_frame: NDArray[np.bool_]
    present: Floats
    disagreement: Floats
    distance: float
    blur_px: float


def assemble(
    photo: Photo,
    plane: Plane,
    line: Centreline,
    toes: tuple[Toes, Toes],
    unit: float,
    band: BandEvidence,
    start: str | None,
) -> BeadMeasurement:
    """Stations, one per row of `line`; `EvidenceError` when the evidence carries no width at all.

    `unit` is the length of a photo px.
    """
    left, right = toes
    width = right.offset - left.offset
    typical = median(width)
    reasons = _reasons(left, right, width, typical, line)
    left_px, right_px, centre_px = _points(plane, line, left, right)
    bead = _bead_rows(left.present)
    round_ends = _ends(photo, centre_px, bead, typical, line, unit)
    reasons[round_ends] = END
    flagged = reasons != ""
    ends = [_at_frame(photo, centre_px[end], typical / unit) for end in _ends_of(bead)]
    length = np.inf if all(ends) else float(np.ptp(line.s[bead]))
    weak = flagged | _faint(left.bare) | _faint(right.bare)
    evidence = _evidence(toes, weak[bead], typical, band, unit, length)
    found = doubts(evidence)
    sure = confidence(found)
    if found[0].confidence < _REFUSED:
        raise EvidenceError(
            f"{photo.name}: a band was found, but its width cannot be told (confidence "
            f"{sure:.2f}): {found[0].sentence}; take a sharper photo with even light, "
            "from above"
        )
    u_noise = np.hypot(left.u_noise, right.u_noise)
    backwards, starts_at = _direction(centre_px, start)
    order = slice(None, None, -1) if backwards else slice(None)
    sides = (right_px, left_px) if backwards else (left_px, right_px)
    s = line.s[bead]
    return BeadMeasurement(
        unit=plane.unit,
        s=(s[-1] - s[::-1] if backwards else s - s[0]),
        width=np.where(width > 0, width, np.nan)[bead][order],
        u_width=_u_width(left, right, u_noise, width, plane)[bead][order],
        u_noise=u_noise[bead][order],
        left_px=sides[0][bead][order],
        right_px=sides[1][bead][order],
        centre_px=centre_px[bead][order],
        flagged=flagged[bead][order],
        reason=tuple(reasons[bead][order].tolist()),
        unit_per_px=unit,
        confidence=sure,
        warnings=_warnings(plane, found),
        starts_at=starts_at,
        direction_known=start is not None,
        open_start=_at_frame(photo, centre_px[bead][order][0], typical / unit),
        open_stop=_at_frame(photo, centre_px[bead][order][-1], typical / unit),
        tint=tint(evidence)[0],
    )


def _bead_rows(present: Floats) -> slice:
    """The stretch with the most evidence of bead against plate; gaps inside it stay."""
    gathered = np.concatenate([[0.0], np.cumsum(np.clip(present, -1, 1))])
    gain = gathered - np.minimum.accumulate(gathered)
    last = int(np.argmax(gain))
    if gain[last] <= 0:
        return slice(0, len(present))
    first = last - int(np.argmin(gathered[last::-1]))
    return slice(first, last)


def _ends_of(bead: slice) -> tuple[int, int]:
    return int(bead.start), int(bead.stop) - 1


def _ends(
    photo: Photo, centre_px: Points, bead: slice, typical: float, line: Centreline, unit: float
) -> NDArray[np.bool_]:
    """Rows within half a width of a start or stop in the photo, where the bead is round."""
    rows = np.arange(len(centre_px))
    reach = _ROUND_END * typical / float(line.s[1] - line.s[0])
    ends = np.zeros(len(rows), dtype=bool)
    for end in _ends_of(bead):
        if not _at_frame(photo, centre_px[end], typical / unit):
            ends |= np.abs(rows - end) < reach
    return ends


def _reasons(
    left: Toes, right: Toes, width: Floats, typical: float, line: Centreline
) -> NDArray[np.str_]:
    """Why a row is not to be trusted, or ''."""
    found = []
    for name, toe in (("left", left), ("right", right)):
        found += [
            (f"{name} toe strays", _strays(toe.offset, typical, line) | ~toe.within),
            (f"{name} toe too faint", toe.u_noise > _FAINT * typical),
            (f"{name} toe not told from the plate", _faint(toe.height)),
            (f"{name} toe at the frame of the photo", ~toe.in_frame),
        ]
    found += [("no bead seen", left.present < 0), ("no width", width <= 0)]
    reason = np.zeros(len(width), dtype=np.int64)
    for number, (_, rows) in enumerate(found, 1):
        reason[rows] = number
    return np.array(["", *(sentence for sentence, _ in found), END])[reason]


def _faint(height: Floats) -> NDArray[np.bool_]:
    return np.asarray(height < 0.15 * median(height))


def _strays(offset: Floats, typical: float, line: Centreline) -> NDArray[np.bool_]:
    step = float(line.s[1] - line.s[0])
    size = 2 * int(max(3, 0.5 * typical / step) // 2) + 1
    away = offset - median_filter(offset, size, mode="nearest")
    spread = 1.4826 * median(np.abs(away))
    return np.asarray(np.abs(away) > np.maximum(6 * spread, 0.06 * typical))


def _u_width(left: Toes, right: Toes, u_noise: Floats, width: Floats, plane: Plane) -> Floats:
    """Standard uncertainty: noise, edge model (both toes, rectangular), scale, plane residual.

    What waviness was smoothed away adds up: the ripples of a bead push both toes out at once.
    """
    model = np.hypot(left.u_model, right.u_model) / np.sqrt(3)
    scale = plane.scale_relative_u * width
    residual = plane.residual * np.sqrt(2)
    smeared = left.smeared + right.smeared
    return np.asarray(np.sqrt(u_noise**2 + model**2 + smeared**2 + scale**2 + residual**2))


def _evidence(
    toes: tuple[Toes, Toes],
    flagged: NDArray[np.bool_],
    typical: float,
    band: BandEvidence,
    step: float,
    length: float,
) -> Evidence:
    astray = max(median(toe.disagreement) for toe in toes)
    return Evidence(
        apart=min(toe.distance for toe in toes),
        band=band.evidence,
        flagged=float(flagged.mean()),
        rival=band.rival,
        inner=band.inner,
        flank=band.flank,
        nested=band.nested,
        sharper=band.sharper,
        step_grey=min(median(np.abs(toe.bare)) for toe in toes),
        lengths=length / typical,
        width_px=typical / step,
        astray=astray / max(typical, step),
        blur_px=min(toe.blur_px for toe in toes),
    )


def _warnings(plane: Plane, found: list[Doubt]) -> tuple[str, ...]:
    warnings = serious(found)
    if plane.unit == "px":
        warnings.insert(0, "no calibration: widths are in pixels, not in millimetres")
    if confidence(found) < TRUSTED:
        warnings.append(f"confidence is low ({confidence(found):.2f}): check the overlay")
    return tuple(warnings)


def _points(
    plane: Plane, line: Centreline, left: Toes, right: Toes
) -> tuple[Points, Points, Points]:
    middle = (left.offset + right.offset) / 2
    a, b, c = (plane.to_px(line.shifted(offset)) for offset in (left.offset, right.offset, middle))
    return a, b, c


def _direction(centre_px: Points, start: str | None) -> tuple[bool, str]:
    """Whether the rows run against the weld, and which end of the photo s = 0 lies at."""
    along = centre_px[-1] - centre_px[0]
    if start is None:
        axis = int(np.argmax(np.abs(along)))
        return bool(along[axis] < 0), ("left", "top")[axis]
    axis = 0 if start in ("left", "right") else 1
    towards = along[axis] if start in ("left", "top") else -along[axis]
    return bool(towards < 0), start


def _at_frame(photo: Photo, point: Points, width_px: float) -> bool:
    x, y = point
    margin = max(6.0, 0.25 * width_px)
    nearest = min(x, y, photo.width_px - 1 - x, photo.height_px - 1 - y)
    return bool(nearest < margin)
