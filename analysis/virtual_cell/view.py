"""Where the webcam looks: pixels of the picture and the plane of the workpiece, fixed frame."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seamlog.calibration import PlaneCalibration

Floats = NDArray[np.float64]

WIDTH_PX, HEIGHT_PX = 640, 480
_CORNERS_PX = ((0.0, 0.0), (639.0, 0.0), (639.0, 479.0), (0.0, 479.0))
_CORNERS_MM = ((-104.0, -41.0), (-103.0, 240.0), (98.0, 234.0), (97.0, -33.0))
"""(X, y) seen at the corners: the camera leans a little towards the operator."""
MARKER_X_MM = -34.0
"""The marker on the torch shines at this X of the plane, at the torch's own y."""

_SOURCE = (
    "Virtual webcam, exact. The plane is the top of the workpiece in the fixed frame of camera "
    "and robot: first coordinate X across the seam (torch at X = 0), second y along the robot's "
    "travel, mm. A place on the workpiece has the table coordinate x = X - q, q = table travel "
    "(/table/encoder position) at the exposure. The torch is at X = 0 and at the y of "
    f"/robot/marker, whose own X is {MARKER_X_MM:g} mm."
)


def homography(source: ArrayLike, target: ArrayLike) -> Floats:
    """The 3 x 3 projective map of four points onto four others, each of shape (4, 2)."""
    rows = []
    for (x, y), (u, v) in zip(np.asarray(source), np.asarray(target), strict=True):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y])
    solution = np.linalg.solve(np.array(rows, dtype=np.float64), np.asarray(target).reshape(8))
    return np.append(solution, 1.0).reshape(3, 3)


def project(matrix: Floats, points: ArrayLike) -> Floats:
    """Points of shape (n, 2) through a homography."""
    flat = np.atleast_2d(np.asarray(points, dtype=np.float64))
    raised = np.column_stack([flat, np.ones(len(flat))]) @ matrix.T
    return np.asarray(raised[:, :2] / raised[:, 2:])


MM_FROM_PX = homography(_CORNERS_PX, _CORNERS_MM)
"""(column, row) to (X, y) in the fixed frame."""
PX_FROM_MM: Floats = np.linalg.inv(MM_FROM_PX).astype(np.float64)


def px_of(x_fixed_mm: ArrayLike, y_mm: ArrayLike) -> Floats:
    """Pixels (column, row), shape (n, 2), of places in the fixed frame."""
    places = np.empty((np.size(y_mm), 2))
    places[:, 0], places[:, 1] = x_fixed_mm, y_mm
    return project(PX_FROM_MM, places)


def calibration_json(
    mm_from_px: Floats, size_px: tuple[int, int], source: str, in_table_frame: bool
) -> bytes:
    """A plane calibration as the JSON of its file; `size_px` is (width, height)."""
    a, b, c = (tuple(float(value) for value in row) for row in mm_from_px)
    calibration = PlaneCalibration(
        schema="seamlog.calibration",
        image_width_px=size_px[0],
        image_height_px=size_px[1],
        date="2026-01-01",
        source=source,
        plane_mm_from_px=((a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2])),
        residual_mm=0.05,
        scale_relative_u=0.002,
        frame="table" if in_table_frame else "plane",
    )
    return calibration.model_dump_json(by_alias=True, indent=2).encode()


def camera_calibration() -> bytes:
    """The file of the webcam, `calibration/table_from_camera.json`."""
    return calibration_json(MM_FROM_PX, (WIDTH_PX, HEIGHT_PX), _SOURCE, in_table_frame=True)
