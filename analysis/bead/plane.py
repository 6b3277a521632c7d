"""The plane a bead is measured in: millimetres by a calibration, or pixels without one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import Calibration, PlaneCalibration
from seamlog.errors import CalibrationError

from .image import Photo

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Plane:
    """Homography between photo pixels and the measuring plane.

    `unit` is `mm` or `px`; `scale_relative_u` the relative standard uncertainty of a length;
    `residual` the rms distance of the calibration points, in `unit`.
    """

    plane_from_px: NDArray[np.float64]
    unit: str
    scale_relative_u: float
    residual: float
    in_table_frame: bool = False

    def to_plane(self, points_px: Points) -> Points:
        """Plane coordinates of photo points, shape (n, 2)."""
        return _project(self.plane_from_px, points_px)

    def to_px(self, points: Points) -> Points:
        """Photo pixels of plane points, shape (n, 2)."""
        return _project(self.px_from_plane(), points)

    def px_from_plane(self) -> NDArray[np.float64]:
        """The inverse homography, shape (3, 3)."""
        return np.asarray(np.linalg.inv(self.plane_from_px), dtype=np.float64)

    def unit_per_px(self, points_px: Points) -> float:
        """Median length of a pixel at these photo points: the root of its area in the plane."""
        half_x, half_y = np.array([0.5, 0.0]), np.array([0.0, 0.5])
        right = self.to_plane(points_px + half_x) - self.to_plane(points_px - half_x)
        down = self.to_plane(points_px + half_y) - self.to_plane(points_px - half_y)
        area = np.abs(right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0])
        return float(np.sqrt(np.median(area)))


def _project(matrix: NDArray[np.float64], points: Points) -> Points:
    homogeneous = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def plane_of(photo: Photo, calibration: Calibration | None) -> Plane:
    """The plane of a photo; without calibration its pixels.

    Raises `CalibrationError` when the calibration was made for a picture of another size.
    """
    if calibration is None:
        return Plane(np.eye(3), "px", 0.0, 0.0)
    size = (calibration.image_width_px, calibration.image_height_px)
    if size != (photo.width_px, photo.height_px):
        raise CalibrationError(
            f"{photo.name} has {photo.width_px} x {photo.height_px} px and its calibration is for "
            f"{size[0]} x {size[1]} px; use the calibration of this camera and picture size"
        )
    if isinstance(calibration, PlaneCalibration):
        return Plane(
            calibration.matrix(),
            "mm",
            calibration.scale_relative_u,
            calibration.residual_mm,
            calibration.frame == "table",
        )
    scale = calibration.mm_per_px
    return Plane(np.diag([scale, scale, 1.0]), "mm", calibration.scale_relative_u, 0.0)
