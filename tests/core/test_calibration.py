"""Calibrations as files, and the lens they may hold."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from seamlog.calibration import (
    Lens,
    LensCalibration,
    PlaneCalibration,
    load_calibration,
    parse_any_calibration,
    parse_calibration,
    rows_of,
)
from seamlog.errors import CalibrationError

LENS = Lens(
    focal_x_px=1500.0,
    focal_y_px=1510.0,
    centre_x_px=655.0,
    centre_y_px=470.0,
    distortion=(-0.22, 0.09, 0.001, -0.0008, 0.01),
)
RNG = np.random.default_rng(3)
POINTS = RNG.uniform((0, 0), (1280, 960), (200, 2))


def plane(lens: Lens | None = LENS) -> PlaneCalibration:
    matrix = np.array([[0.1, 0.004, -60.0], [-0.003, 0.1, -45.0], [1e-5, -2e-5, 1.0]])
    return PlaneCalibration(
        image_width_px=1280,
        image_height_px=960,
        plane_mm_from_px=rows_of(matrix),
        lens=lens,
        residual_mm=0.001,
        scale_relative_u=0.0005,
    )


def test_distortion_is_that_of_opencv() -> None:
    rays = np.column_stack([(POINTS - (655, 470)) / (1500, 1510), np.ones(len(POINTS))])
    seen, _ = cv2.projectPoints(
        rays, np.zeros(3), np.zeros(3), LENS.matrix(), np.array(LENS.distortion)
    )
    assert LENS.distorted(POINTS) == pytest.approx(seen[:, 0], abs=1e-9)


def test_straightening_undoes_the_distortion() -> None:
    assert LENS.straightened(LENS.distorted(POINTS)) == pytest.approx(POINTS, abs=1e-8)


def test_points_that_no_lens_of_this_model_shows_are_unknown() -> None:
    strong = LENS.model_copy(update={"distortion": (-0.6, 0.0, 0.0, 0.0, 0.0)})
    assert np.isnan(strong.straightened(np.array([[9000.0, 470.0]]))).all()


def test_plane_and_picture_are_inverse_to_each_other() -> None:
    for lens in (LENS, None):
        assert plane(lens).px(plane(lens).plane_mm(POINTS)) == pytest.approx(POINTS, abs=1e-7)


def test_a_file_comes_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "camera.calibration.json"
    path.write_text(plane().model_dump_json(by_alias=True))
    assert load_calibration(path) == plane()


def test_a_lens_alone_has_no_millimetres() -> None:
    lens = LensCalibration(
        image_width_px=1280, image_height_px=960, lens=LENS, residual_px=0.05, photos=9
    )
    text = lens.model_dump_json(by_alias=True)
    assert parse_any_calibration(text, "lens.json") == lens
    with pytest.raises(CalibrationError, match="calibrate plane"):
        parse_calibration(text, "lens.json")


@pytest.mark.parametrize("content", ["", "{", "[]", '{"kind": "plane"}', '{"kind": "map"}'])
def test_what_is_no_calibration_is_said(content: str) -> None:
    with pytest.raises(CalibrationError, match=r"x\.json"):
        parse_any_calibration(content, "x.json")


def test_bytes_that_are_no_text_are_no_calibration() -> None:
    with pytest.raises(CalibrationError, match="no text"):
        parse_any_calibration(b"\xff\xfe\x00", "x.json")
