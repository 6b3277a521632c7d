"""What a camera says in millimetres: calibrations as files with their residual and their age.

A plane calibration is a homography from picture pixels to a plane in millimetres, found from a
board or from known points of that plane. A scale is the weaker kind: a ruler or a known length,
good on its own line only. Neither is ever invented: without a file there are pixels.
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from seamlog.errors import CalibrationError

Row = tuple[float, float, float]


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


class PlaneCalibration(_Calibration):
    """Homography `plane_mm_from_px` (3 x 3, rows) with its residual.

    `scale_relative_u` is the relative standard uncertainty of a length in the plane; `residual_mm`
    the rms distance of the calibration points. `frame` says what the plane's axes are; only a
    plane in the `table` frame ties the photo to the table.
    """

    kind: Literal["plane"] = "plane"
    plane_mm_from_px: tuple[Row, Row, Row]
    residual_mm: float = Field(ge=0)
    scale_relative_u: float = Field(ge=0)
    frame: Literal["plane", "table"] = "plane"

    @model_validator(mode="after")
    def _invertible(self) -> "PlaneCalibration":
        if abs(float(np.linalg.det(self.matrix()))) < 1e-12:
            raise ValueError("plane_mm_from_px has no inverse")
        return self

    def matrix(self) -> NDArray[np.float64]:
        """The homography, shape (3, 3)."""
        return np.array(self.plane_mm_from_px, dtype=np.float64)


class ScaleCalibration(_Calibration):
    """A length known on one line of the picture: weaker, see docs/glossary.md."""

    kind: Literal["scale"] = "scale"
    mm_per_px: float = Field(gt=0)
    scale_relative_u: float = Field(ge=0)


Calibration = PlaneCalibration | ScaleCalibration


class _File(BaseModel):
    content: Annotated[Calibration, Field(discriminator="kind")]


def parse_calibration(text: str | bytes, where: str) -> Calibration:
    """Read a calibration from JSON; `where` names it in errors (`CalibrationError`)."""
    raw = text.decode() if isinstance(text, bytes) else text
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
