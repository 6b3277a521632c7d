"""A height profile across the bead to its figures: height, toe angles, undercut, misalignment.

The plate is a straight line on each side, fitted robustly; the toes are where the weld face, made
straight near its foot, meets the plate.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

Floats = NDArray[np.float64]

_FEWEST = 40
_LEAST_HEIGHT = 6.0
"""Height of a bead against the scatter of the plate."""
_UNDERCUT_REACH_MM = 1.5
_FLANK_MM = 1.0
_CLEAR_MM = 2.0


@dataclass(frozen=True, slots=True)
class ProfileFigures:
    """Figures of one profile, mm and degrees, with the standard uncertainty of a height.

    `toe_angles_deg` left and right: between plate and weld face, through the air, 180 is flat.
    `undercut_mm` is the deeper side's depth below the plate, 0 where there is none;
    `misalignment_mm` how far right plate and left plate lie apart at the bead's middle.
    """

    height_mm: float
    width_mm: float
    toe_angles_deg: tuple[float, float]
    undercut_mm: float
    misalignment_mm: float
    u_height_mm: float
    toes_mm: tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Side:
    """One side seen from the bead: plate line z = a + b x and where the weld face begins."""

    plate: tuple[float, float]
    toe_mm: float
    angle_deg: float
    undercut_mm: float
    scatter_mm: float


def profile_figures(x_mm: Floats, z_mm: Floats, relative_u: float = 0.0) -> ProfileFigures:
    """Figures of a profile: places across the seam and heights, each of shape (n,).

    `relative_u` is the relative standard uncertainty of a length of the sensor. Raises
    `EvidenceError` where the profile shows no bead on a plate.
    """
    known = np.isfinite(x_mm) & np.isfinite(z_mm)
    order = np.argsort(x_mm[known], kind="stable")
    x, z = x_mm[known][order], z_mm[known][order]
    if len(x) < _FEWEST or np.ptp(x) <= 0:
        raise EvidenceError(f"a profile of {len(x)} points is too short, {_FEWEST} are needed")
    peak = _peak(x, z)
    left = _side(x[x <= peak][::-1], z[x <= peak][::-1], -1)
    right = _side(x[x >= peak], z[x >= peak], 1)
    return _figures(x, z, left, right, relative_u)


def _peak(x: Floats, z: Floats) -> float:
    """Place of the greatest height over a line through both outer fifths of the profile."""
    outer = (x < x[0] + 0.2 * np.ptp(x)) | (x > x[-1] - 0.2 * np.ptp(x))
    a, b = _line(x[outer], z[outer])
    calm = _running_median(z - a - b * x, 5)
    scatter = 1.4826 * float(np.median(np.abs(calm[outer] - np.median(calm[outer])))) + 1e-6
    inner = np.flatnonzero(~outer)
    at = inner[int(np.argmax(calm[inner]))]
    if calm[at] < _LEAST_HEIGHT * scatter:
        raise EvidenceError(
            f"the profile shows no bead: nothing is higher than {_LEAST_HEIGHT:g} times the "
            f"plate's scatter ({scatter:.3f} mm)"
        )
    high = inner[calm[inner] > 0.9 * calm[at]]
    return float(np.median(x[high]))


def _side(x: Floats, z: Floats, outwards: int) -> _Side:
    """Plate, toe, angle and undercut of one side; points from the bead's middle outwards."""
    reach = abs(x[-1] - x[0])
    plate_from = 0.6 * reach
    for _ in range(4):
        away = np.abs(x - x[0])
        beyond = away >= plate_from
        if beyond.sum() < 8:
            raise EvidenceError("the profile shows too little plate beside the bead")
        a, b = _line(x[beyond], z[beyond])
        above = z - a - b * x
        scatter = max(1.4826 * float(np.median(np.abs(above[beyond]))), 1e-3)
        foot = _foot(above, scatter)
        plate_from = min(away[foot] + _CLEAR_MM, 0.85 * reach)
    toe, angle = _toe(x, above, foot, b, outwards)
    calm = _running_median(above, 3)
    near = (np.abs(x - toe) <= _UNDERCUT_REACH_MM) & (calm < 0)
    deepest = -float(calm[near].min()) if near.any() else 0.0
    undercut = deepest if deepest > 4 * scatter else 0.0
    return _Side((a, b), toe, angle, undercut, scatter)


def _foot(above: Floats, scatter: float) -> int:
    """The outermost point from which on inwards the weld face lies over the plate."""
    over = _running_median(above, 5) > max(4 * scatter, 0.05 * float(above.max()))
    below = np.flatnonzero(~over)
    return int(below[0]) if len(below) else len(above) - 1


def _toe(x: Floats, above: Floats, foot: int, slope: float, outwards: int) -> tuple[float, float]:
    """Where the weld face, straight over its lowest millimetre, meets the plate; and the angle."""
    inside = (np.abs(x - x[foot]) <= _FLANK_MM) & (np.arange(len(x)) <= foot)
    low = inside & (above > 0)
    if low.sum() < 3:
        return float(x[foot]), 180.0
    a, b = _line(x[low], above[low])
    if b * outwards >= 0:
        return float(x[foot]), 180.0
    toe = -a / b
    face, plate = np.arctan(-(b + slope) * outwards), np.arctan(-slope * outwards)
    angle = 180.0 - float(np.degrees(face - plate))
    limit = _FLANK_MM
    return float(np.clip(toe, x[foot] - limit, x[foot] + limit)), angle


def _figures(x: Floats, z: Floats, left: _Side, right: _Side, relative_u: float) -> ProfileFigures:
    (la, lb), (ra, rb) = left.plate, right.plate
    left_z, right_z = la + lb * left.toe_mm, ra + rb * right.toe_mm
    width = float(np.hypot(right.toe_mm - left.toe_mm, right_z - left_z))
    if right.toe_mm - left.toe_mm <= 0:
        raise EvidenceError("the profile's toes could not be told apart")
    base = left_z + (x - left.toe_mm) * (right_z - left_z) / (right.toe_mm - left.toe_mm)
    inside = (x > left.toe_mm) & (x < right.toe_mm)
    if inside.sum() < 5:
        raise EvidenceError("the profile has too few points on the bead")
    height = float(_running_median((z - base)[inside], 5).max())
    middle = (left.toe_mm + right.toe_mm) / 2
    slope = (lb + rb) / 2
    step = (ra + rb * middle) - (la + lb * middle)
    scatter = float(np.hypot(left.scatter_mm, right.scatter_mm)) / 2
    return ProfileFigures(
        height_mm=height * float(np.cos(np.arctan(slope))),
        width_mm=width,
        toe_angles_deg=(left.angle_deg, right.angle_deg),
        undercut_mm=max(left.undercut_mm, right.undercut_mm),
        misalignment_mm=abs(step) * float(np.cos(np.arctan(slope))),
        u_height_mm=float(np.hypot(scatter, relative_u * height)),
        toes_mm=(left.toe_mm, right.toe_mm),
    )


def _line(x: Floats, z: Floats) -> tuple[float, float]:
    """Z = a + b x, by least squares with weights of Tukey against what lies off the line."""
    middle = float(x.mean())
    weight = np.ones(len(x))
    a = b = 0.0
    for _ in range(8):
        total = weight.sum()
        mean_x = float((weight * (x - middle)).sum() / total)
        mean_z = float((weight * z).sum() / total)
        away = x - middle - mean_x
        b = float((weight * away * (z - mean_z)).sum() / max((weight * away**2).sum(), 1e-12))
        a = mean_z - b * (mean_x + middle)
        off = z - a - b * x
        scale = 4.685 * max(1.4826 * float(np.median(np.abs(off))), 1e-4)
        weight = np.clip(1 - (off / scale) ** 2, 0, None) ** 2 + 1e-9
    return a, b


def _running_median(values: Floats, size: int) -> Floats:
    padded = np.pad(values, size // 2, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, size), axis=1))
