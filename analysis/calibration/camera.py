"""Several photos of a board to the calibration of a camera's lens."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import Lens, LensCalibration
from seamlog.errors import EvidenceError

from .board import BoardView

FEWEST_PHOTOS = 3
_WORST_FOCAL_U = 0.02
_FEW_PHOTOS = 5
_LEAST_TILT_DEG = 8.0


def calibrate_camera(
    views: Sequence[BoardView], size_px: tuple[int, int], date: str | None = None
) -> LensCalibration:
    """Lens from views of one board at different tilts.

    `EvidenceError` with too few views, or where they are so alike that the focal length is not
    known to 2 %.
    """
    if len(views) < FEWEST_PHOTOS:
        raise EvidenceError(
            f"{len(views)} photos show the board, {FEWEST_PHOTOS} are needed, better 10, tilted "
            "to all sides; for one photo use 'seamlog calibrate plane'"
        )
    flags = cv2.CALIB_FIX_K3 if len(views) < _FEW_PHOTOS else 0
    solid = [np.column_stack([view.mm, np.zeros(len(view.mm))]) for view in views]
    rms, matrix, coefficients, turns, _, deviations, *_ = cv2.calibrateCameraExtended(
        [points.astype(np.float32) for points in solid],
        [view.px.astype(np.float32) for view in views],
        size_px,
        np.eye(3),
        np.zeros(5),
        flags=flags,
    )
    focal_u = float(np.max(np.ravel(deviations)[:2])) / float(matrix[0, 0])
    tilts = _tilts_deg(turns)
    if not (focal_u < _WORST_FOCAL_U and tilts > _LEAST_TILT_DEG):
        raise EvidenceError(
            f"the photos are too alike to tell the focal length (tilts differ by {tilts:.0f} "
            "degrees); tilt the board by 20 to 45 degrees to all sides"
        )
    k1, k2, p1, p2, k3 = (float(value) for value in np.ravel(coefficients)[:5])
    lens = Lens(
        focal_x_px=float(matrix[0, 0]),
        focal_y_px=float(matrix[1, 1]),
        centre_x_px=float(matrix[0, 2]),
        centre_y_px=float(matrix[1, 2]),
        distortion=(k1, k2, p1, p2, k3),
    )
    return LensCalibration(
        image_width_px=size_px[0],
        image_height_px=size_px[1],
        date=date,
        source=f"{len(views)} photos of a board; focal length known to {100 * focal_u:.2g} %",
        lens=lens,
        residual_px=float(rms),
        photos=len(views),
    )


def _tilts_deg(turns: Sequence[NDArray[Any]]) -> float:
    """Largest angle between the board's normals in two photos."""
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    return float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0)).max()))
