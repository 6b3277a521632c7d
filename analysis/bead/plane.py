"""The plane a bead is measured in: millimetres by a calibration, or pixels without one."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import Calibration, Lens, PlaneCalibration, projected
from seamlog.errors import CalibrationError

from .image import Photo
from .series import median

Points = NDArray[np.float64]

_SIDES = np.array([[-0.5, 0.0], [0.5, 0.0], [0.0, -0.5], [0.0, 0.5]])
"""The middles of a pixel's left, right, upper and lower side, from its centre."""


@dataclass(frozen=True, slots=True)
class Plane:
    """Homography between photo pixels, freed from the lens's distortion, and the measuring plane.

    `unit` is `mm` or `px`; `scale_relative_u` the relative standard uncertainty of a length;
    `residual` the rms distance of the calibration points, in `unit`; `frame_u` the standard
    uncertainty of places in the table frame.
    """

    plane_from_px: NDArray[np.float64]
    unit: str
    scale_relative_u: float
    residual: float
    in_table_frame: bool = False
    lens: Lens | None = None
    frame_u: float = 0.0
    px_from_plane: NDArray[np.float64] = field(init=False, repr=False, compare=False)
    """The inverse homography, shape (3, 3), to pixels freed from the lens's distortion."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "px_from_plane", np.linalg.inv(self.plane_from_px))

    def to_plane(self, points_px: Points) -> Points:
        """Plane coordinates of photo points, shape (n, 2)."""
        ideal = self.lens.straightened(points_px) if self.lens else points_px
        return projected(self.plane_from_px, ideal)

    def to_px(self, points: Points) -> Points:
        """Photo pixels of plane points, shape (n, 2)."""
        ideal = projected(self.px_from_plane, points)
        return self.lens.distorted(ideal) if self.lens else ideal

    def through_lens(self, x: NDArray[Any], y: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Photo pixels of what an ideal lens would show at x, y (arrays of one shape)."""
        if self.lens is None:
            return x, y
        bent = self.lens.distorted(np.stack([x, y], axis=-1))
        return bent[..., 0], bent[..., 1]

    def unit_per_px(self, points_px: Points) -> float:
        """Median length of a pixel at these photo points: the root of its area in the plane."""
        sides = self.to_plane((points_px + _SIDES[:, None]).reshape(-1, 2)).reshape(4, -1, 2)
        right, down = sides[1] - sides[0], sides[3] - sides[2]
        area = np.abs(right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0])
        return float(np.sqrt(median(area)))


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
            calibration.lens,
            calibration.frame_u_mm,
        )
    scale = calibration.mm_per_px
    return Plane(np.diag([scale, scale, 1.0]), "mm", calibration.scale_relative_u, 0.0)
