"""The photo tied to the seam: which place on the bead the torch passed when it was at `s_mm`.

Three ways, in this order: a photo in the table frame; the bead's ends and the side of its start, as
somebody said; the shape of the bead's path where it is not the same from its other end. What they
cannot tell is refused.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from seamlog.errors import EvidenceError

from .bead.measurement import BeadMeasurement
from .bead.plane import Plane, Points
from .bead.stitch import backwards
from .torch_path import TorchPath

Floats = NDArray[np.float64]

WORST_U_S_MM = 5.0
_IN_FRAME = "the photo's place in the table frame"
_BOTH = "start and stop of the bead tied to arc on and arc off"
_START = "start of the bead tied to arc on"
_SHAPE = "shape of the bead's path laid over the torch's"
_ENDS_REACH_MM = 8.0
_STEP_MM = 0.5
_LEAST_OVERLAP = 0.6
_INDEPENDENT_MM = 10.0
"""Length along which a path's deviations are alike."""
_CLEARLY_WORSE = 2.0
_LEAST_SHAPE_MM = 0.3
_WORST_ASIDE_MM = 2.0
_SHIFTS = 12


@dataclass(frozen=True, slots=True)
class Tie:
    """How the photo's arc length becomes that of the torch: s_torch = s_photo - offset_mm.

    `backwards`: the photo's arc length runs against the weld and is turned first.
    """

    offset_mm: float
    u_s_mm: float
    method: str
    backwards: bool = False


def tie_bead(bead: BeadMeasurement, torch: TorchPath, plane: Plane | None = None) -> Tie:
    """Tie the bead to the torch's path; `EvidenceError` says why it cannot be done.

    `plane` is that of the photo; without it only the bead's ends and `--start` are left.
    """
    if bead.unit != "mm":
        raise EvidenceError("the photo has no calibration, so its pixels have no place in mm")
    if plane is not None and plane.in_table_frame and len(torch.path_mm):
        return _checked(_in_table_frame(bead, torch, plane))
    if bead.direction_known:
        return _checked(_by_ends(bead, torch))
    if plane is None or not len(torch.path_mm):
        raise EvidenceError("the direction is ambiguous; say with --start where the weld began")
    return _checked(_by_shape(bead, torch, plane))


def _checked(tie: Tie) -> Tie:
    if tie.u_s_mm > WORST_U_S_MM:
        raise EvidenceError(
            f"places on the bead are known to {tie.u_s_mm:.1f} mm only ({tie.method}), "
            f"{WORST_U_S_MM:g} mm are needed; check that photo and weld belong together"
        )
    return tie


def _in_table_frame(bead: BeadMeasurement, torch: TorchPath, plane: Plane) -> Tie:
    """Each station goes to the nearest place of the torch's path on the plate.

    The marker shows the torch's place along the robot's travel (y); how far it sits beside the
    torch (x) is not recorded and is taken from the bead itself.
    """
    good = np.flatnonzero(bead.good)
    if len(good) < 3:
        raise EvidenceError("too few stations of the bead could be measured")
    dense_s = np.arange(0.0, torch.s_mm[-1], 0.1)
    aside, nearest = _nearest(plane.to_plane(bead.centre_px[good]), _path_at(torch, dense_s))
    inner = (nearest > 0) & (nearest < len(dense_s) - 1)
    off = float(np.median(aside[inner])) if inner.any() else float(aside.min())
    if inner.sum() < max(3, 0.5 * len(good)) or off > _WORST_ASIDE_MM:
        raise EvidenceError(
            f"on the table the bead lies {off:.0f} mm off the torch's path, and "
            f"{100 * inner.mean():.0f} % of it beside it; check that photo, calibration and weld "
            "belong together"
        )
    turned = bool(np.polyfit(bead.s[good][inner], dense_s[nearest[inner]], 1)[0] < 0)
    if turned and bead.direction_known:
        raise EvidenceError(
            f"the weld did not begin at the {bead.starts_at}, as --start says: in the table frame "
            "it runs the other way"
        )
    s = bead.s[-1] - bead.s if turned else bead.s
    away = s[good][inner] - dense_s[nearest[inner]]
    offset = float(np.median(away))
    spread = 1.4826 * float(np.median(np.abs(away - offset)))
    u = float(np.sqrt(torch.u_s_mm**2 + plane.frame_u**2 + spread**2))
    return Tie(offset, u, _IN_FRAME, turned)


def _nearest(places: Points, path: Points) -> tuple[Floats, NDArray[np.intp]]:
    """Distance to the path and its nearest point, the path shifted across (x) to fit best."""
    shift = np.array([float(np.median(places[:, 0]) - np.median(path[:, 0])), 0.0])
    tree = cKDTree(path)
    for _ in range(_SHIFTS):
        aside, nearest = (np.asarray(found) for found in tree.query(places - shift))
        shift[0] = float(np.median(places[:, 0] - path[nearest, 0]))
    return aside, nearest


def _by_ends(bead: BeadMeasurement, torch: TorchPath) -> Tie:
    if bead.open_start:
        raise EvidenceError("the start of the bead is not in the photo, so nothing ties it to time")
    width = float(np.nanmedian(bead.width))
    u_end = width / 6
    if bead.open_stop:
        return Tie(width / 2, float(np.hypot(torch.u_s_mm, u_end)), _START)
    surplus = float(bead.s[-1] - torch.s_mm[-1])
    miss = abs(surplus - width) / 2
    return Tie(surplus / 2, float(np.hypot(torch.u_s_mm, max(miss, u_end))), _BOTH)


@dataclass(frozen=True, slots=True)
class _Laid:
    """A bead's path laid over the torch's: offset, its uncertainty and the rms left, mm."""

    offset_mm: float
    u_mm: float
    rms_mm: float


def _by_shape(bead: BeadMeasurement, torch: TorchPath, plane: Plane) -> Tie:
    """The direction in which the paths fit clearly better, and the offset that fits best."""
    ways = [(turned, _laid_over(bead, torch, plane, turned)) for turned in (False, True)]
    (turned, best), (_, other) = sorted(ways, key=lambda way: way[1].rms_mm)
    clear = max(_CLEARLY_WORSE * best.rms_mm, best.rms_mm + _LEAST_SHAPE_MM)
    if not np.isfinite(best.rms_mm) or other.rms_mm < clear:
        raise EvidenceError(
            "the direction is ambiguous: the bead's path fits the torch's from either end "
            f"({best.rms_mm:.1f} and {other.rms_mm:.1f} mm rms); say with --start where the weld "
            "began"
        )
    if best.rms_mm > max(WORST_U_S_MM, 0.5 * float(np.nanmedian(bead.width))):
        raise EvidenceError(
            f"the bead's path does not fit the torch's ({best.rms_mm:.1f} mm rms); check that "
            "photo and weld belong together"
        )
    shape = Tie(best.offset_mm, float(np.hypot(torch.u_s_mm, best.u_mm)), _SHAPE, turned)
    directed = backwards(bead) if turned else bead
    if directed.open_start:
        return shape
    ends = _by_ends(directed, torch)
    apart = abs(ends.offset_mm - shape.offset_mm)
    if ends.u_s_mm < shape.u_s_mm and apart < 2 * (ends.u_s_mm + shape.u_s_mm):
        return Tie(ends.offset_mm, ends.u_s_mm, f"{ends.method}, direction by the shape", turned)
    return shape


def _laid_over(bead: BeadMeasurement, torch: TorchPath, plane: Plane, turned: bool) -> _Laid:
    directed = backwards(bead) if turned else bead
    good = directed.good
    s, places = directed.s[good], _from_above(plane, directed.centre_px[good])
    offsets = _offsets(directed, torch)
    rms = np.array([_rms(s - offset, places, torch) for offset in offsets])
    if not np.isfinite(rms).any():
        return _Laid(0.0, np.inf, np.inf)
    best = int(np.nanargmin(rms))
    count = max(min(float(np.ptp(s)), float(torch.s_mm[-1])) / _INDEPENDENT_MM, 4.0)
    likely = rms**2 <= max(rms[best], torch.u_s_mm / 4, 0.05) ** 2 * (1 + 4 / (count - 3))
    return _Laid(float(offsets[best]), float(np.ptp(offsets[likely])) / 2 + _STEP_MM, rms[best])


def _offsets(bead: BeadMeasurement, torch: TorchPath) -> Floats:
    """Offsets to be tried: near the ends where both are in the photo, else all that overlap."""
    length = float(torch.s_mm[-1])
    if not bead.open_start and not bead.open_stop:
        middle = (float(bead.s[-1]) - length) / 2
        return np.arange(middle - _ENDS_REACH_MM, middle + _ENDS_REACH_MM + 1e-9, _STEP_MM)
    overlap = _LEAST_OVERLAP * min(length, float(bead.s[-1]))
    return np.arange(overlap - length, float(bead.s[-1]) - overlap + 1e-9, _STEP_MM)


def _rms(s: Floats, places: Points, torch: TorchPath) -> float:
    """What is left when the bead's path is turned and shifted onto the torch's, not mirrored."""
    inside = (s >= 0) & (s <= torch.s_mm[-1])
    if inside.sum() < max(10, _LEAST_OVERLAP * min(len(s), len(places))):
        return float("nan")
    seen, path = places[inside], _path_at(torch, s[inside])
    seen, path = seen - seen.mean(axis=0), path - path.mean(axis=0)
    turn = np.arctan2(
        np.sum(seen[:, 0] * path[:, 1] - seen[:, 1] * path[:, 0]), np.sum(seen * path)
    )
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return float(np.sqrt(np.mean(np.sum((seen @ rotation.T - path) ** 2, axis=1))))


def _path_at(torch: TorchPath, s_mm: Floats) -> Points:
    return np.column_stack([np.interp(s_mm, torch.s_mm, torch.path_mm[:, k]) for k in range(2)])


def _from_above(plane: Plane, px: Points) -> Points:
    """Places in a right-handed plane seen from above, whatever the hand of the calibration."""
    middle = px.mean(axis=0)
    origin, right, down = plane.to_plane(middle + np.array([[0.0, 0], [1, 0], [0, 1]]))
    (ax, ay), (bx, by) = right - origin, down - origin
    return plane.to_plane(px) * (1.0, -1.0 if ax * by - ay * bx > 0 else 1.0)
