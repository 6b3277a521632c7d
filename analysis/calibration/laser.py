"""A light plane from points of known place in it, such as the corners of steps and gauge blocks."""

import cv2
import numpy as np

from seamlog.calibration import Lens, PlaneCalibration, Points, projected, rows_of
from seamlog.errors import EvidenceError, UsageError

_FEWEST = 4
_WORST_MISS = 0.02
"""Part of the points' extent that a point may miss its place by."""


def calibrate_laser(
    px: Points,
    laser_mm: Points,
    size_px: tuple[int, int],
    lens: Lens | None = None,
    date: str | None = None,
) -> PlaneCalibration:
    """Plane of the laser light: px (n, 2) to x across the seam and z up, mm (n, 2), n >= 4.

    Raises `EvidenceError` where points and places do not fit, or lie on one line.
    """
    if len(px) < _FEWEST or len(px) != len(laser_mm):
        raise UsageError(f"{len(px)} points are too few for a light plane; give {_FEWEST} or more")
    ideal = lens.straightened(px) if lens else px
    extent = float(np.hypot(*np.ptp(laser_mm, axis=0)))
    thinnest = float(np.linalg.svd(laser_mm - laser_mm.mean(axis=0), compute_uv=False)[-1])
    matrix, _ = cv2.findHomography(ideal, laser_mm, 0)
    if matrix is None or thinnest < 0.02 * extent:
        raise EvidenceError(
            "the points lie on one line, so heights stay unknown; use points of different height"
        )
    misses = projected(np.asarray(matrix, dtype=np.float64), ideal) - laser_mm
    worst = float(np.hypot(*misses.T).max())
    if worst > _WORST_MISS * extent:
        raise EvidenceError(f"a point misses its place by {worst:.2f} mm; check points and places")
    free = max(2 * len(px) - 8, 1)
    residual = float(np.sqrt(np.sum(misses**2) / free))
    return PlaneCalibration(
        image_width_px=size_px[0],
        image_height_px=size_px[1],
        date=date,
        source=f"light plane from {len(px)} points, which miss their places by {worst:.3f} mm",
        plane_mm_from_px=rows_of(np.asarray(matrix, dtype=np.float64)),
        lens=lens,
        residual_mm=residual,
        scale_relative_u=max(residual / max(thinnest, 1e-9), 0.002),
        frame="laser",
    )
