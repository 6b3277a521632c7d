"""A plane tied to the table: points of the photo whose place on the table is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import PlaneCalibration, Points, rows_of
from seamlog.errors import EvidenceError, UsageError

WORST_MISS_MM = 2.0


@dataclass(frozen=True, slots=True)
class TableFit:
    """The plane in the table frame, and by how much each point misses its place."""

    calibration: PlaneCalibration
    misses_mm: NDArray[np.float64]


def calibrate_table(
    plane: PlaneCalibration, px: Points, table_mm: Points, table_at_mm: float = 0.0
) -> TableFit:
    """Turn and shift a plane so that photo points `px` (n, 2) lie at `table_mm` (n, 2).

    `table_at_mm` is where the table stood when the photo was taken; places are those the points
    have with the table at 0. Raises `EvidenceError` where points and places do not fit.
    """
    if len(px) < 2 or len(px) != len(table_mm):
        raise UsageError(
            f"{len(px)} points are too few; name two or more whose place on the table is known"
        )
    seen = plane.plane_mm(px)
    wanted = table_mm - np.array([table_at_mm, 0.0])
    turn, shift = _rigid(seen, wanted)
    misses = np.hypot(*(seen @ turn.T + shift - wanted).T)
    worst = float(misses.max())
    if worst > WORST_MISS_MM:
        raise EvidenceError(
            f"a point misses its place on the table by {worst:.1f} mm; check points, places and "
            "the plane's calibration"
        )
    move = np.eye(3)
    move[:2, :2], move[:2, 2] = turn, shift
    miss = float(np.sqrt(np.mean(misses**2)))
    calibration = plane.model_copy(
        update={
            "plane_mm_from_px": rows_of(move @ plane.matrix()),
            "frame": "table",
            "frame_u_mm": miss if len(px) > 2 else WORST_MISS_MM / 2,
            "source": f"{plane.source}; tied to the table by {len(px)} points, which miss their "
            f"places by {miss:.2g} mm rms",
        }
    )
    return TableFit(calibration, misses)


def _rigid(seen: Points, wanted: Points) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation and shift of least squares (Kabsch 1976), no mirroring."""
    a, b = seen.mean(axis=0), wanted.mean(axis=0)
    u, _, v = np.linalg.svd((seen - a).T @ (wanted - b))
    mirrored = np.sign(np.linalg.det(v.T @ u.T))
    turn = v.T @ np.diag([1.0, mirrored]) @ u.T
    return turn, b - turn @ a
