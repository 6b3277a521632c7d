"""Known lengths and rulers in a photo to a scale: the weaker kind, with its error.

A length gives the scale on its own line. Away from it tilt and height add to the error, unless a
second length, best on the other side of the bead, shows the tilt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from seamlog.calibration import Calibration, PlaneCalibration, Points, ScaleCalibration, rows_of
from seamlog.errors import EvidenceError, UsageError

from .plane import TYPICAL_FOCAL

ALONE_U, BESIDE_U = 0.04, 0.0035
"""Relative uncertainty of one length: somewhere in the photo; in the bead's plane beside it."""
TILTED_U = 0.005
"""What height alone adds where the tilt is known."""
READING_PX = 0.5
_SHORTEST_PX = 30.0
_APART = 0.05
"""Lengths show a tilt if they lie this part of the picture beside each other."""
_USUAL_TILT = 0.2
"""Change of scale over the picture that is usual: keeps misread lengths from making a tilt."""


@dataclass(frozen=True, slots=True)
class KnownLength:
    """Two points of the photo, (x, y) in px, and their distance in mm."""

    mm: float
    start_px: tuple[float, float]
    stop_px: tuple[float, float]
    reading_px: float = READING_PX

    def ends(self) -> Points:
        """Both points, shape (2, 2)."""
        return np.array([self.start_px, self.stop_px], dtype=np.float64)

    @property
    def px(self) -> float:
        """Distance in px."""
        return float(np.hypot(*np.diff(self.ends(), axis=0)[0]))

    @property
    def relative_u(self) -> float:
        """Of reading both ends."""
        return self.reading_px * float(np.sqrt(2)) / self.px


def calibrate_scale(
    lengths: Sequence[KnownLength],
    size_px: tuple[int, int],
    beside_bead: bool = False,
    name: str = "photo",
    date: str | None = None,
) -> Calibration:
    """Scale from one length, or scale and tilt from lengths apart from each other.

    `beside_bead` says that the one length lies in the bead's plane right beside it.
    """
    if not lengths:
        raise UsageError("no known length; give --length or --ruler")
    for length in lengths:
        _check(length, size_px, name)
    if _on_both_sides(lengths, size_px):
        return _tilted(lengths, size_px, name, date)
    scales = np.array([length.mm / length.px for length in lengths])
    weights = np.array([length.px for length in lengths])
    scale = float(np.average(scales, weights=weights))
    spread = float(np.ptp(scales)) / scale / 2
    place = BESIDE_U if beside_bead else ALONE_U
    reading = min(length.relative_u for length in lengths)
    return ScaleCalibration(
        image_width_px=size_px[0],
        image_height_px=size_px[1],
        date=date,
        source=_one_source(lengths, beside_bead),
        mm_per_px=scale,
        scale_relative_u=float(np.sqrt(place**2 + reading**2 + spread**2)),
    )


def _one_source(lengths: Sequence[KnownLength], beside_bead: bool) -> str:
    known = ", ".join(f"{length.mm:g} mm" for length in lengths)
    where = (
        f"in the bead's plane beside it ({100 * BESIDE_U:g} %)"
        if beside_bead
        else f"tilt and height of the bead are not known, so +- {100 * ALONE_U:g} %; a second "
        "length on the other side of the bead would show the tilt"
    )
    return f"known length: {known}; {where}"


def _check(length: KnownLength, size_px: tuple[int, int], name: str) -> None:
    if not length.mm > 0:
        raise UsageError(f"{name}: a length of {length.mm:g} mm cannot be")
    ends = length.ends()
    if (ends < -0.5).any() or (ends > np.array(size_px) - 0.5).any():
        raise UsageError(
            f"{name}: the length of {length.mm:g} mm ends outside the photo, which has "
            f"{size_px[0]} x {size_px[1]} px"
        )
    if length.px < _SHORTEST_PX:
        raise EvidenceError(
            f"{name}: the length of {length.mm:g} mm is {length.px:.0f} px long, too short to "
            f"carry a scale; {_SHORTEST_PX:g} px are needed, better a third of the picture"
        )


def _on_both_sides(lengths: Sequence[KnownLength], size_px: tuple[int, int]) -> bool:
    """Whether the lengths lie beside each other rather than on one line, as on one ruler."""
    ends = [length.ends() for length in lengths]
    middles = np.array([pair.mean(axis=0) for pair in ends])
    along = (ends[0][1] - ends[0][0]) / lengths[0].px
    aside = middles @ np.array([-along[1], along[0]])
    return bool(np.ptp(aside) > _APART * max(size_px))


def _tilted(
    lengths: Sequence[KnownLength], size_px: tuple[int, int], name: str, date: str | None
) -> PlaneCalibration:
    """Homography of a plane seen aslant; of all that fit the lengths the one least tilted."""
    middle = np.array(size_px) / 2
    extent = float(max(size_px))

    def matrix(values: NDArray[np.float64]) -> NDArray[np.float64]:
        scale, tilt = np.exp(values[0]), values[1:] / extent
        away = np.array([[1, 0, -middle[0]], [0, -1, middle[1]], [0, 0, 1.0]])
        lean = np.array([[scale, 0, 0], [0, scale, 0], [tilt[0], -tilt[1], 1.0]])
        return np.asarray(lean @ away)

    def misses(values: NDArray[np.float64]) -> NDArray[np.float64]:
        off = [np.log(_length_mm(matrix(values), item) / item.mm) for item in lengths]
        weighed = np.array(off) / np.array([item.relative_u for item in lengths])
        return np.concatenate([weighed, values[1:] / _USUAL_TILT])

    start = np.log(np.median([item.mm / item.px for item in lengths]))
    solved = least_squares(misses, np.array([start, 0.0, 0.0]))
    found = matrix(solved.x)
    off = np.array([_length_mm(found, item) / item.mm - 1 for item in lengths])
    worst = float(np.abs(off).max())
    if worst > 0.05:
        raise EvidenceError(
            f"{name}: no plane fits the known lengths (off by {100 * worst:.0f} %); check them"
        )
    steep = TYPICAL_FOCAL * float(np.hypot(*solved.x[1:]))
    shortened = float(np.sqrt(1 + steep**2)) - 1
    reading = float(np.mean([item.relative_u for item in lengths]))
    u = float(np.sqrt(TILTED_U**2 + shortened**2 + worst**2 + reading**2))
    known = ", ".join(f"{item.mm:g} mm" for item in lengths)
    return PlaneCalibration(
        image_width_px=size_px[0],
        image_height_px=size_px[1],
        date=date,
        source=f"known lengths: {known}; tilt about {np.degrees(np.arctan(steep)):.1f} degrees "
        f"(typical lens); lengths missed by {100 * worst:.2g} % at most",
        plane_mm_from_px=rows_of(found),
        residual_mm=0.0,
        scale_relative_u=u,
    )


def _length_mm(matrix: NDArray[np.float64], length: KnownLength) -> float:
    raised = np.column_stack([length.ends(), np.ones(2)]) @ matrix.T
    a, b = raised[:, :2] / raised[:, 2:]
    return float(np.hypot(*(b - a)))
