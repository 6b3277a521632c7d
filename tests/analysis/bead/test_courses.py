"""Beads that end in the photo, bend, or run across it at any angle, with the path found."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.strip import measure_strip

Floats = NDArray[np.float64]
Course = Callable[[Floats], tuple[Floats, Floats]]

ROWS, COLUMNS, FINER = 440, 660, 4
HALF_PX = 22


def closed(t: Floats) -> tuple[Floats, Floats]:
    return 110 + 440 * t, 220 + 0 * t


def one_end(t: Floats) -> tuple[Floats, Floats]:
    return -40 + 510 * t, 220 + 15 * np.sin(3 * t)


def arc(t: Floats) -> tuple[Floats, Floats]:
    angle = np.pi * (0.25 + 0.5 * t)
    return 330 - 350 * np.cos(angle), 510 - 350 * np.sin(angle)


def upright(t: Floats) -> tuple[Floats, Floats]:
    return 330 + 20 * np.sin(6 * t), -30 + 500 * t


def steep(t: Floats) -> tuple[Floats, Floats]:
    return 150 + 370 * t, -20 + 480 * t


def along(t: Floats) -> tuple[Floats, Floats]:
    return -40 + 740 * t, 220 + 8 * np.sin(5 * t)


def drawn(course: Course, half_px: int = HALF_PX) -> NDArray[np.uint8]:
    """A bright bead of constant width on a plate with some texture."""
    rng = np.random.default_rng(0)
    mask = np.zeros((ROWS * FINER, COLUMNS * FINER), np.uint8)
    for x, y in zip(*course(np.linspace(0, 1, 400)), strict=True):
        cv2.circle(mask, (round(x * FINER), round(y * FINER)), half_px * FINER, 255, -1)
    covered = cv2.resize(mask, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA) / 255
    texture = 12 * cv2.GaussianBlur(rng.standard_normal((ROWS, COLUMNS)), (0, 0), 1.5)
    picture = 95 + 0.6 * texture + covered * (75 + 1.5 * texture)
    noisy = cv2.GaussianBlur(picture, (0, 0), 1.0) + 2 * rng.standard_normal(picture.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("course", "open_ends"), [(closed, 0), (one_end, 1), (arc, 0), (upright, 2), (steep, 2)]
)
def test_width_of_a_bead_of_any_course(course: Course, open_ends: int) -> None:
    photo = make_photo(drawn(course), f"{course.__name__}.png")
    result = measure_strip(photo, plane_of(photo, None))
    error = result.width[result.good] - 2 * HALF_PX
    assert np.abs(np.median(error)) <= 0.3
    assert np.abs(error).max() <= 1.5
    assert result.flagged.mean() <= 0.15
    assert result.open_start + result.open_stop == open_ends
    assert result.trusted


def test_a_bead_that_ends_in_the_photo_ends_there() -> None:
    photo = make_photo(drawn(closed), "closed.png")
    result = measure_strip(photo, plane_of(photo, None))
    assert result.centre_px[0, 0] == pytest.approx(110 - HALF_PX, abs=5)
    assert result.centre_px[-1, 0] == pytest.approx(550 + HALF_PX, abs=5)
    assert {result.reason[0], result.reason[-1]} == {"end of the bead"}


@pytest.mark.parametrize("half_px", [6, 8, HALF_PX, 60, 90, 105])
def test_width_along_a_given_path_from_near_and_from_far(half_px: int) -> None:
    """The path wanders by a fifth of the half width; from near, plate is seen on a few px only."""
    photo = make_photo(drawn(along, half_px), "given.png")
    t = np.linspace(0.06, 0.94, 60)
    x, y = along(t)
    path = np.column_stack([x, y + 0.2 * half_px * np.sin(20 * t)])
    result = measure_strip(photo, plane_of(photo, None), path)
    error = result.width[result.good] - 2 * half_px
    assert np.abs(np.median(error)) <= 0.3
    assert result.flagged.mean() <= 0.15
    assert result.trusted == (half_px >= 15)


def test_the_plate_on_its_table_is_no_bead() -> None:
    rng = np.random.default_rng(3)
    table = np.clip(60 + 25 * rng.standard_normal((900, 1300)), 0, 255).astype(np.uint8)
    table[230:670, 320:980] = drawn(closed)
    x, y = closed(np.linspace(0, 1, 50))
    photo = make_photo(table, "plate.png")
    result = measure_strip(photo, plane_of(photo, None), np.column_stack([x + 320, y + 230]))
    assert np.median(result.width[result.good]) == pytest.approx(2 * HALF_PX, abs=0.3)
    assert result.trusted
