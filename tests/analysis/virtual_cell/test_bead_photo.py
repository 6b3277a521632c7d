import cv2
import numpy as np
import pytest

from seamlog.analysis.virtual_cell.bead_photo import render_bead_photo
from seamlog.analysis.virtual_cell.seam import TrueSeam
from seamlog.analysis.virtual_cell.truth import BeadTruth
from seamlog.analysis.virtual_cell.view import project
from seamlog.calibration import PlaneCalibration, parse_calibration

WIDE_FROM_MM, WIDE_TO_MM = 90.0, 110.0


@pytest.fixture(scope="module")
def photo() -> tuple[np.ndarray, PlaneCalibration]:
    """A straight bead of 6 mm with 20 mm of 8 mm in its middle."""
    s = np.arange(0.0, 200.5, 0.5)
    width = np.where((s > WIDE_FROM_MM) & (s < WIDE_TO_MM), 8.0, 6.0)
    flat = np.zeros_like(s)
    bead = BeadTruth(s, s, flat, flat + 6.0, flat, width, s / 6.0)
    rng = np.random.default_rng(4)
    data, calibration = render_bead_photo(bead, TrueSeam(rng), rng)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    plane = parse_calibration(calibration, "bead.calibration.json")
    assert isinstance(plane, PlaneCalibration)
    return np.asarray(image), plane


def bright_span_mm(photo: tuple[np.ndarray, PlaneCalibration], column: int) -> float:
    """Width of the bright bead across a straight part, from the mean grey of 40 columns."""
    image, plane = photo
    strip = image[250:450, column - 20 : column + 20].mean(axis=(1, 2))
    bright = 250 + np.flatnonzero(strip > np.median(strip[:30]) + 18.0)
    ends = project(plane.matrix(), [[column, bright[0] - 0.5], [column, bright[-1] + 0.5]])
    return float(np.hypot(*(ends[1] - ends[0])))


def test_scale_is_about_a_tenth_of_a_millimetre(
    photo: tuple[np.ndarray, PlaneCalibration],
) -> None:
    image, plane = photo
    assert image.shape == (plane.image_height_px, plane.image_width_px, 3)
    ends = project(plane.matrix(), [[1200, 350], [1300, 350]])
    assert np.hypot(*(ends[1] - ends[0])) == pytest.approx(10.0, rel=0.03)


def test_bead_is_as_wide_as_the_truth_says(photo: tuple[np.ndarray, PlaneCalibration]) -> None:
    narrow = [bright_span_mm(photo, column) for column in (500, 600, 700, 800, 1700)]
    wide = [bright_span_mm(photo, column) for column in (1140, 1170, 1210, 1240, 1270)]
    assert np.median(narrow) == pytest.approx(6.0, abs=0.2)
    assert np.median(wide) - np.median(narrow) == pytest.approx(2.0, abs=0.2)


def test_photo_lies_in_a_plane_of_its_own(photo: tuple[np.ndarray, PlaneCalibration]) -> None:
    assert photo[1].frame == "plane"
