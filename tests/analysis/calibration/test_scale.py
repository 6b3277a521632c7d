"""Known lengths, rulers and points of the table: the weaker ways to millimetres."""

import cv2
import numpy as np
import pytest

from seamlog.analysis.calibration.ruler import read_ruler
from seamlog.analysis.calibration.scale import KnownLength, calibrate_scale
from seamlog.analysis.calibration.table import calibrate_table
from seamlog.calibration import PlaneCalibration, ScaleCalibration, projected, rows_of
from seamlog.errors import EvidenceError, UsageError

SIZE = (1600, 1000)


def tilted_plane(lean: float = 2e-5) -> np.ndarray:
    """mm from px, 0.1 mm in the middle, nearer at the picture's lower edge."""
    away = np.array([[1, 0, -800.0], [0, -1, 500.0], [0, 0, 1]])
    leaning = np.array([[1, 0, 0], [0, 1, 0], [0, lean, 1]])
    return np.asarray(np.diag([0.1, 0.1, 1.0]) @ leaning @ away, dtype=np.float64)


def length_across(matrix: np.ndarray, row_px: float) -> KnownLength:
    ends = np.array([[300.0, row_px], [1300.0, row_px]])
    a, b = projected(matrix, ends)
    return KnownLength(float(np.hypot(*(b - a))), (300.0, row_px), (1300.0, row_px))


def test_one_length_is_weak_and_says_so() -> None:
    found = calibrate_scale([KnownLength(100.0, (300, 500), (1300, 500))], SIZE)
    assert isinstance(found, ScaleCalibration)
    assert found.mm_per_px == pytest.approx(0.1)
    assert found.scale_relative_u >= 0.04
    assert "second length" in found.source
    beside = calibrate_scale([KnownLength(100.0, (300, 500), (1300, 500))], SIZE, beside_bead=True)
    assert 0.0035 <= beside.scale_relative_u < 0.006


def test_lengths_on_both_sides_show_the_tilt() -> None:
    truth = tilted_plane()
    found = calibrate_scale([length_across(truth, 200), length_across(truth, 800)], SIZE)
    assert isinstance(found, PlaneCalibration)
    middle = length_across(truth, 500)
    a, b = found.plane_mm(middle.ends())
    assert np.hypot(*(b - a)) == pytest.approx(middle.mm, rel=1e-3)
    assert 0.004 < found.scale_relative_u < 0.02
    only = calibrate_scale([length_across(truth, 200)], SIZE)
    assert isinstance(only, ScaleCalibration)
    assert abs(only.mm_per_px * middle.px / middle.mm - 1) < 2 * only.scale_relative_u


@pytest.mark.parametrize(
    ("length", "error"),
    [
        (KnownLength(0.0, (0, 0), (900, 0)), UsageError),
        (KnownLength(10.0, (0, 0), (9000, 0)), UsageError),
        (KnownLength(1.0, (0, 0), (9, 0)), EvidenceError),
    ],
)
def test_lengths_that_cannot_be_are_refused(length: KnownLength, error: type[Exception]) -> None:
    with pytest.raises(error, match=r"x\.jpg"):
        calibrate_scale([length], SIZE, name="x.jpg")


def test_lengths_that_contradict_each_other_are_refused() -> None:
    one, other = (KnownLength(100.0, (300, y), (1300, y)) for y in (200.0, 800.0))
    third = KnownLength(150.0, (300, 500), (1300, 500))
    with pytest.raises(EvidenceError, match="no plane fits"):
        calibrate_scale([one, third, other], SIZE)
    with pytest.raises(UsageError, match="--ruler"):
        calibrate_scale([], SIZE)


def ruler(matrix: np.ndarray, noise: float) -> np.ndarray:
    """A steel ruler along x at y = 20 mm: ticks each mm, longer ones each 5 and 10 mm."""
    rng = np.random.default_rng(4)
    column, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    mm = projected(matrix, np.column_stack([column.ravel(), row.ravel()]).astype(float))
    x, y = mm[:, 0].reshape(row.shape), mm[:, 1].reshape(row.shape)
    tick = np.rint(x)
    long = 3.0 + 1.5 * (tick % 5 == 0) + 2.0 * (tick % 10 == 0)
    dark = np.clip((0.12 - np.abs(x - tick)) / 0.05 + 0.5, 0, 1) * ((y > 20) & (y < 20 + long))
    picture = cv2.GaussianBlur(180.0 - 130 * dark, (0, 0), 1.0)
    noisy = picture + noise * rng.standard_normal(picture.shape)
    return np.asarray(np.clip(noisy, 0, 255), dtype=np.uint8)


def test_a_ruler_is_counted() -> None:
    truth = tilted_plane()
    photo = ruler(truth, 6.0)
    ends = projected(np.linalg.inv(truth), np.array([[-60.0, 21.5], [60.0, 21.5]]))
    stretches = read_ruler(photo, 1.0, ends[0], ends[1], "ruler.png")
    for stretch in stretches:
        a, b = projected(truth, stretch.ends())
        assert stretch.mm == pytest.approx(np.hypot(*(b - a)), rel=2e-3)
    assert sum(stretch.mm for stretch in stretches) == pytest.approx(0.88 * 120, rel=2e-3)


def test_a_line_off_the_ruler_is_refused() -> None:
    photo = ruler(tilted_plane(), 6.0)
    with pytest.raises(EvidenceError, match="no even ticks"):
        read_ruler(photo, 1.0, np.array([100.0, 900.0]), np.array([1500.0, 900.0]), "ruler.png")
    with pytest.raises(EvidenceError, match="too short"):
        read_ruler(photo, 1.0, np.array([100.0, 900.0]), np.array([110.0, 900.0]), "ruler.png")


def plane() -> PlaneCalibration:
    return PlaneCalibration(
        image_width_px=SIZE[0],
        image_height_px=SIZE[1],
        plane_mm_from_px=rows_of(tilted_plane()),
        residual_mm=0.01,
        scale_relative_u=0.001,
    )


def test_points_of_known_place_tie_a_plane_to_the_table() -> None:
    px = np.array([[200.0, 150.0], [1400.0, 180.0], [800.0, 900.0]])
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    places = plane().plane_mm(px) @ turn.T + np.array([12.0, 140.0])
    rough = places + np.array([[0.05, 0.0], [0.0, -0.05], [0.03, 0.02]])
    fit = calibrate_table(plane(), px, rough + np.array([30.0, 0.0]), table_at_mm=30.0)
    assert fit.calibration.frame == "table"
    assert fit.calibration.plane_mm(px) == pytest.approx(places, abs=0.1)
    assert 0.01 < fit.calibration.frame_u_mm < 0.1
    with pytest.raises(EvidenceError, match="misses its place"):
        calibrate_table(plane(), px, places * np.array([1.0, 1.2]))
    with pytest.raises(UsageError, match="two or more"):
        calibrate_table(plane(), px[:1], places[:1])
