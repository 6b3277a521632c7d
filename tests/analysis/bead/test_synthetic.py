"""The generator: what it says is what it draws."""

from dataclasses import replace

import numpy as np
import pytest

from seamlog.analysis.bead.synthetic import CASES, Scene, render

SMALL = Scene(width_px=256, height_px=160, blur_px=0.0)


def test_same_seed_same_picture() -> None:
    scene = replace(CASES["hard"], width_px=256, height_px=160)
    assert (render(scene, 1).pixels == render(scene, 1).pixels).all()
    assert (render(scene, 1).pixels != render(scene, 2).pixels).any()


@pytest.mark.parametrize("perspective", [0.0, 1.0])
def test_toes_lie_where_the_truth_says(perspective: float) -> None:
    bead = render(replace(SMALL, perspective=perspective), 5)
    keep = (bead.x_mm > 3) & (bead.x_mm < 22)
    slope = np.gradient(bead.y_mm, bead.x_mm)[keep]
    normal = np.column_stack([-slope, np.ones_like(slope)]) / np.hypot(1, slope)[:, None]
    seam = np.column_stack([bead.x_mm, bead.y_mm])[keep]
    px_from_mm = np.linalg.inv(bead.calibration.matrix())
    for side, half in ((-1, bead.left_mm[keep]), (1, bead.right_mm[keep])):
        for beyond, level in ((-0.2, SMALL.base + SMALL.contrast), (0.2, SMALL.base)):
            points = seam + (side * (half + beyond))[:, None] * normal
            raised = np.column_stack([points, np.ones(len(points))]) @ px_from_mm.T
            column, row = np.rint(raised[:, :2] / raised[:, 2:]).astype(int).T
            assert (bead.pixels[row, column] == level).all()


def test_a_pixel_at_a_toe_is_as_bright_as_the_part_of_it_that_is_bead() -> None:
    bead = render(replace(SMALL, width_px=600), 5)
    slope = np.gradient(bead.y_mm, bead.x_mm)
    normal = np.column_stack([-slope, np.ones_like(slope)]) / np.hypot(1, slope)[:, None]
    seam = np.column_stack([bead.x_mm, bead.y_mm])
    left = seam - bead.left_mm[:, None] * normal
    right = seam + bead.right_mm[:, None] * normal
    x_mm = (np.arange(30, 570) + 0.5) * SMALL.mm_per_px
    high_mm = np.interp(x_mm, *right.T) - np.interp(x_mm, *left.T)
    bright = (bead.pixels[:, 30:570] - SMALL.base).sum(axis=0) / SMALL.contrast
    assert bright * SMALL.mm_per_px == pytest.approx(high_mm, abs=0.004)


@pytest.mark.parametrize("case", list(CASES))
def test_every_case_renders_bead_and_plate(case: str) -> None:
    scene = replace(CASES[case], width_px=256, height_px=160)
    pixels = render(scene, 0).pixels
    assert pixels.shape == (160, 256)
    assert np.ptp(pixels) > 15


def test_noise_has_the_strength_asked_for() -> None:
    quiet, noisy = render(SMALL, 1), render(replace(SMALL, noise=5.0), 1)
    plate = np.s_[:20, :]
    spread = (noisy.pixels[plate].astype(float) - quiet.pixels[plate]).std()
    assert spread == pytest.approx(5.0, rel=0.1)
