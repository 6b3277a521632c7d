"""Boards to planes and lenses, on renderings with exactly known truth."""

import numpy as np
import pytest

from seamlog.analysis.calibration.board import Board, BoardView, find_board
from seamlog.analysis.calibration.camera import calibrate_camera
from seamlog.analysis.calibration.plane import Placing, calibrate_plane
from seamlog.analysis.calibration.synthetic import View, render_board
from seamlog.calibration import Lens, LensCalibration, PlaneCalibration
from seamlog.errors import CalibrationError, EvidenceError, UsageError

LENS = Lens(
    focal_x_px=1150.0,
    focal_y_px=1150.0,
    centre_x_px=485.0,
    centre_y_px=352.0,
    distortion=(-0.15, 0.05, 0.0004, -0.0003, 0.0),
)
VIEW = View(LENS, 960, 720, 150.0, (8.0, -5.0), 3.0, noise=2.0)
CHESSBOARD = Board(14, 10, 8.0)
CHARUCO = Board(14, 10, 8.0, 6.0, "DICT_5X5_100")


def length_errors_um(found: PlaneCalibration, truth: PlaneCalibration) -> np.ndarray:
    """Errors of 300 lengths of 6 mm over the middle three quarters of the photo."""
    rng = np.random.default_rng(5)
    size = np.array([truth.image_width_px, truth.image_height_px])
    start_px = rng.uniform(0.125 * size, 0.875 * size, (300, 2))
    angle = rng.uniform(0, 2 * np.pi, 300)
    away_mm = 6 * np.column_stack([np.cos(angle), np.sin(angle)])
    stop_px = truth.px(truth.plane_mm(start_px) + away_mm)
    apart = found.plane_mm(start_px) - found.plane_mm(stop_px)
    return np.asarray(1e3 * (np.hypot(*apart.T) - 6))


@pytest.mark.parametrize("board", [CHESSBOARD, CHARUCO], ids=["chessboard", "charuco"])
def test_six_millimetres_through_a_distorting_lens(board: Board) -> None:
    photo, truth = render_board(board, VIEW, 1)
    found = calibrate_plane(photo, board, Placing(square_u_mm=0.004))
    assert found.lens is not None
    assert np.sqrt(np.mean(length_errors_um(found, truth) ** 2)) <= 2.0
    assert 0.0005 < found.scale_relative_u < 0.003
    without = found.model_copy(update={"lens": None})
    assert np.sqrt(np.mean(length_errors_um(without, truth) ** 2)) > 20


def test_inner_corners_may_be_counted_instead_of_squares() -> None:
    photo, truth = render_board(CHESSBOARD, VIEW, 1)
    found = calibrate_plane(photo, Board(13, 9, 8.0), Placing())
    assert np.sqrt(np.mean(length_errors_um(found, truth) ** 2)) <= 2.0


def test_the_plane_is_right_handed_seen_from_above() -> None:
    photo, _ = render_board(CHESSBOARD, VIEW, 1)
    found = calibrate_plane(photo, CHESSBOARD, Placing())
    origin, right, down = found.plane_mm(np.array([[400.0, 300], [410, 300], [400, 310]]))
    assert np.cross(np.append(right - origin, 0), np.append(down - origin, 0))[2] < 0


def test_the_plate_lies_below_a_thick_board() -> None:
    """The board's face is 3 mm nearer than the plate: 2 % at 150 mm."""
    photo, _ = render_board(CHESSBOARD, VIEW, 1)
    below = View(LENS, 960, 720, 153.0, VIEW.tilt_deg, VIEW.turn_deg)
    _, plate = render_board(CHESSBOARD, below, 1)
    lens = LensCalibration(
        image_width_px=960, image_height_px=720, lens=LENS, residual_px=0.0, photos=9
    )
    for given, placing in ((lens, Placing(3.0)), (None, Placing(3.0, distance_mm=150.0))):
        found = calibrate_plane(photo, CHESSBOARD, placing, given)
        assert np.abs(np.mean(length_errors_um(found, plate))) < 12
    with pytest.raises(UsageError, match="--distance-mm"):
        calibrate_plane(photo, CHESSBOARD, Placing(3.0))


def seen_corners(tilts: list[tuple[float, float]]) -> list[BoardView]:
    """Views of the board as corners with 0.03 px of noise; no picture is rendered."""
    rng = np.random.default_rng(2)
    column, row = np.meshgrid(np.arange(13), np.arange(9))
    mm = 8.0 * np.column_stack([column.ravel(), row.ravel()]).astype(np.float64)
    views = []
    for tilt in tilts:
        small = View(LENS, 8, 8, 190.0, tilt)
        _, plane = render_board(CHESSBOARD, small)
        views.append(BoardView(plane.px(mm) + 0.03 * rng.standard_normal(mm.shape), mm, "made"))
    return views


def test_a_lens_from_tilted_views() -> None:
    tilts = [(25.0, 0.0), (-25.0, 5.0), (0.0, 28.0), (3.0, -28.0), (20.0, 20.0), (-20.0, 18.0)]
    found = calibrate_camera(seen_corners(tilts), (960, 720), "2026-01-01")
    assert found.lens.focal_x_px == pytest.approx(LENS.focal_x_px, rel=3e-3)
    px = np.random.default_rng(1).uniform((60, 60), (900, 660), (100, 2))
    bent, straight = found.lens.distorted(px) - px, LENS.distorted(px) - px
    assert np.abs(bent - straight).max() < 1.0
    assert found.residual_px < 0.08


def test_views_that_are_alike_or_few_carry_no_lens() -> None:
    with pytest.raises(EvidenceError, match="too alike"):
        calibrate_camera(seen_corners([(0.0, 0.0), (0.2, 0.0), (0.0, 0.2)]), (960, 720))
    with pytest.raises(EvidenceError, match="2 photos"):
        calibrate_camera(seen_corners([(20.0, 0.0), (0.0, 20.0)]), (960, 720))


def test_what_shows_no_board_is_refused() -> None:
    rng = np.random.default_rng(0)
    for photo in (np.full((300, 400), 90, np.uint8), rng.integers(0, 255, (300, 400, 3), np.uint8)):
        for board in (CHESSBOARD, CHARUCO):
            with pytest.raises(EvidenceError, match=r"plate\.jpg"):
                find_board(photo, board, "plate.jpg")


def test_a_lens_of_another_size_and_impossible_boards_are_refused() -> None:
    lens = LensCalibration(
        image_width_px=640, image_height_px=480, lens=LENS, residual_px=0.0, photos=9
    )
    with pytest.raises(CalibrationError, match="640 x 480"):
        calibrate_plane(np.zeros((720, 960), np.uint8), CHESSBOARD, Placing(), lens)
    for arguments in ((2, 9, 8.0), (9, 7, 0.0), (9, 7, 8.0, 9.0)):
        with pytest.raises(UsageError):
            Board(*arguments)
