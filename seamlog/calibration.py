"""What a camera says in millimetres: calibrations as files with their residual and their age.

A plane calibration is a homography from picture pixels, freed from the lens's distortion, to a
plane in millimetres, found from a board or from known points of that plane. A scale is the weaker
kind: a ruler or a known length, good on its own line only. A lens alone has no millimetres; a
plane is fitted with it. None is ever invented: without a file there are pixels.
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from seamlog.errors import CalibrationError

Row = tuple[float, float, float]
Points = NDArray[np.float64]

_ROUNDS = 60
_CLOSE = 1e-12


class _Calibration(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_: Literal["seamlog.calibration"] = Field("seamlog.calibration", alias="schema")
    version: int = 1
    image_width_px: int = Field(gt=0)
    image_height_px: int = Field(gt=0)
    date: str | None = None
    """Day of the calibration, ISO 8601."""
    source: str = ""
    """How it was made, in words."""


class Lens(BaseModel):
    """Camera matrix and distortion of a lens, in the model of Brown (1966) as OpenCV writes it.

    `distortion` holds k1, k2, p1, p2, k3. Where the focal length is not known (one view of one
    plane) any will do: the distortion goes with it.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    focal_x_px: float = Field(gt=0)
    focal_y_px: float = Field(gt=0)
    centre_x_px: float
    centre_y_px: float
    distortion: tuple[float, float, float, float, float]

    def distorted(self, points_px: Points) -> Points:
        """Where the picture shows what an ideal lens would show at `points_px`, shape (n, 2)."""
        return self._px(self._bent(self._normal(points_px)))

    def straightened(self, points_px: Points) -> Points:
        """The inverse of `distorted`; NaN for points beyond where the model can be inverted."""
        seen = self._normal(points_px)
        ideal = seen.copy()
        for _ in range(_ROUNDS):
            step = seen - self._bent(ideal)
            ideal = ideal + np.clip(step, -1.0, 1.0)
            if not step.size or float(np.abs(step).max()) < _CLOSE:
                break
        lost = np.abs(seen - self._bent(ideal)).max(axis=1) > 1e-4
        return np.where(lost[:, None], np.nan, self._px(ideal))

    def matrix(self) -> NDArray[np.float64]:
        """The camera matrix, shape (3, 3)."""
        return np.array(
            [
                [self.focal_x_px, 0.0, self.centre_x_px],
                [0.0, self.focal_y_px, self.centre_y_px],
                [0.0, 0.0, 1.0],
            ]
        )

    def _normal(self, points_px: Points) -> Points:
        centre = (self.centre_x_px, self.centre_y_px)
        return np.asarray((points_px - centre) / (self.focal_x_px, self.focal_y_px))

    def _px(self, normal: Points) -> Points:
        centre = (self.centre_x_px, self.centre_y_px)
        return np.asarray(normal * (self.focal_x_px, self.focal_y_px) + centre)

    def _bent(self, ideal: Points) -> Points:
        k1, k2, p1, p2, k3 = self.distortion
        x, y = ideal[..., 0], ideal[..., 1]
        square = x * x + y * y
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        bent_x = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
        bent_y = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
        return np.stack([bent_x, bent_y], axis=-1)


class LensCalibration(_Calibration):
    """A camera's lens, found from several photos of a board; `residual_px` rms of its corners."""

    kind: Literal["lens"] = "lens"
    lens: Lens
    residual_px: float = Field(ge=0)
    photos: int = Field(gt=0)


class PlaneCalibration(_Calibration):
    """Homography `plane_mm_from_px` (3 x 3, rows) with its residual.

    With a `lens` the homography is for pixels freed from its distortion. `scale_relative_u` is the
    relative standard uncertainty of a length in the plane; `residual_mm` the rms distance of the
    calibration points. `frame` says what the plane's axes are: only a plane in the `table` frame
    ties the photo to the table; `laser` is a light plane, x across the seam and z up.
    """

    kind: Literal["plane"] = "plane"
    plane_mm_from_px: tuple[Row, Row, Row]
    lens: Lens | None = None
    residual_mm: float = Field(ge=0)
    scale_relative_u: float = Field(ge=0)
    frame: Literal["plane", "table", "laser"] = "plane"
    frame_u_mm: float = Field(0.0, ge=0)
    """Standard uncertainty of places in the frame, where it is the table's."""

    @model_validator(mode="after")
    def _invertible(self) -> "PlaneCalibration":
        if abs(float(np.linalg.det(self.matrix()))) < 1e-12:
            raise ValueError("plane_mm_from_px has no inverse")
        return self

    def matrix(self) -> NDArray[np.float64]:
        """The homography, shape (3, 3)."""
        return np.array(self.plane_mm_from_px, dtype=np.float64)

    def plane_mm(self, points_px: Points) -> Points:
        """Places in the plane, mm, of points of the picture, shape (n, 2)."""
        ideal = self.lens.straightened(points_px) if self.lens else points_px
        return projected(self.matrix(), ideal)

    def px(self, points_mm: Points) -> Points:
        """The inverse of `plane_mm`."""
        inverse = np.asarray(np.linalg.inv(self.matrix()), dtype=np.float64)
        ideal = projected(inverse, points_mm)
        return self.lens.distorted(ideal) if self.lens else ideal


class ScaleCalibration(_Calibration):
    """A length known on one line of the picture: weaker, see docs/glossary.md."""

    kind: Literal["scale"] = "scale"
    mm_per_px: float = Field(gt=0)
    scale_relative_u: float = Field(ge=0)


Calibration = PlaneCalibration | ScaleCalibration
AnyCalibration = PlaneCalibration | ScaleCalibration | LensCalibration


def projected(matrix: NDArray[np.float64], points: Points) -> Points:
    """Points of shape (n, 2) through a homography."""
    homogeneous = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def rows_of(matrix: NDArray[np.float64]) -> tuple[Row, Row, Row]:
    """A 3 x 3 matrix as `plane_mm_from_px` holds it, its last entry 1."""
    scaled = matrix / matrix[2, 2]
    a, b, c = ((float(row[0]), float(row[1]), float(row[2])) for row in scaled)
    return a, b, c


class _File(BaseModel):
    content: Annotated[AnyCalibration, Field(discriminator="kind")]


def parse_calibration(text: str | bytes, where: str) -> Calibration:
    """Read a calibration with millimetres from JSON; `where` names it in errors."""
    found = parse_any_calibration(text, where)
    if isinstance(found, LensCalibration):
        raise CalibrationError(
            f"{where} is the calibration of a lens and knows no millimetres; make a plane with it: "
            "'seamlog calibrate plane PHOTO --lens FILE'"
        )
    return found


def parse_any_calibration(text: str | bytes, where: str) -> AnyCalibration:
    """Read a calibration of any kind from JSON; raises `CalibrationError`."""
    try:
        raw = text.decode() if isinstance(text, bytes) else text
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{where} is no text, so no calibration: {error}") from error
    try:
        return _File.model_validate_json('{"content": ' + raw + "}").content
    except ValidationError as error:
        first = error.errors()[0]
        path = ".".join(str(part) for part in first["loc"][1:])
        raise CalibrationError(
            f"{where} is no calibration: {path}: {first['msg']}; make one with the field names "
            "of docs/format.md"
        ) from error


def load_calibration(path: Path) -> Calibration:
    """Read a calibration file (JSON)."""
    return parse_calibration(path.read_bytes(), str(path))
