"""Turning or mirroring a photo does not change the width."""

import cv2
import numpy as np
import pytest

from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import Scene, SyntheticBead, render

SCENE = Scene(width_px=640, height_px=360, noise=3, ripple=8)


@pytest.fixture(scope="module")
def bead() -> SyntheticBead:
    return render(SCENE, 7)


def measured(pixels: np.ndarray, start: str | None = None) -> BeadMeasurement:
    photo = make_photo(np.ascontiguousarray(pixels), "turned")
    return measure_strip(photo, plane_of(photo, None), start=start)


@pytest.fixture(scope="module")
def upright(bead: SyntheticBead) -> BeadMeasurement:
    return measured(bead.pixels, "left")


@pytest.mark.parametrize(
    ("turn", "start"),
    [
        (cv2.ROTATE_90_CLOCKWISE, "top"),
        (cv2.ROTATE_180, "right"),
        (cv2.ROTATE_90_COUNTERCLOCKWISE, "bottom"),
    ],
)
def test_width_of_a_turned_photo(
    bead: SyntheticBead, upright: BeadMeasurement, turn: int, start: str
) -> None:
    turned = measured(cv2.rotate(bead.pixels, turn), start)
    s = np.linspace(40, 560, 100)
    same = np.interp(s, turned.s, turned.width) - np.interp(s, upright.s, upright.width)
    assert np.sqrt(np.mean(same**2)) < 0.35
    assert turned.width[turned.good].mean() == pytest.approx(
        upright.width[upright.good].mean(), abs=0.1
    )


def test_width_of_a_mirrored_photo(bead: SyntheticBead, upright: BeadMeasurement) -> None:
    mirrored = measured(bead.pixels[::-1], "left")
    assert mirrored.width[mirrored.good].mean() == pytest.approx(
        upright.width[upright.good].mean(), abs=0.1
    )


def test_start_orders_the_stations(bead: SyntheticBead) -> None:
    left, right = measured(bead.pixels, "left"), measured(bead.pixels, "right")
    assert left.centre_px[0, 0] < left.centre_px[-1, 0]
    assert right.centre_px[0, 0] > right.centre_px[-1, 0]
    assert right.s[0] == left.s[0] == 0
    assert np.nanmean(right.left_px[:, 1]) > np.nanmean(right.right_px[:, 1])
    assert (left.starts_at, right.starts_at) == ("left", "right")


def test_without_a_start_the_direction_is_not_known(bead: SyntheticBead) -> None:
    assert not measured(bead.pixels).direction_known


def test_sixteen_bits_and_colour_give_the_same_width(
    bead: SyntheticBead, upright: BeadMeasurement
) -> None:
    deep = measured(bead.pixels.astype(np.uint16) * 257, "left")
    coloured = measured(np.stack([bead.pixels, bead.pixels, bead.pixels], axis=2), "left")
    for other in (deep, coloured):
        assert np.nanmax(np.abs(other.width - upright.width)) < 1e-2
