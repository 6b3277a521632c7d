"""Photos without a bead to measure: refused or doubted, never a width to trust."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import CASES, TINT, Scene, render
from seamlog.analysis.bead.synthetic_surface import brushed
from seamlog.errors import EvidenceError, ImageError

Drawn = Callable[[np.random.Generator], NDArray[np.float64]]
SHAPE = (300, 480)


def noise(rng: np.random.Generator) -> NDArray[np.float64]:
    return 128 + 20 * rng.standard_normal(SHAPE)


def coloured_noise(rng: np.random.Generator) -> NDArray[np.float64]:
    return 128 + 20 * rng.standard_normal((*SHAPE, 3))


def brushed_plate(rng: np.random.Generator) -> NDArray[np.float64]:
    return 100 + brushed(rng, SHAPE, 12) + 2 * rng.standard_normal(SHAPE)


def clouds(rng: np.random.Generator) -> NDArray[np.float64]:
    soft = cv2.GaussianBlur(rng.standard_normal(SHAPE), (0, 0), 8)
    return np.asarray(128 + 800 * soft)


def light_from_one_side(rng: np.random.Generator) -> NDArray[np.float64]:
    return np.linspace(60, 200, SHAPE[1]) + 2 * rng.standard_normal(SHAPE)


def edge_of_a_plate(rng: np.random.Generator) -> NDArray[np.float64]:
    level = np.where(np.arange(SHAPE[1]) < 240, 80.0, 160.0)
    return level + 3 * rng.standard_normal(SHAPE)


def disc(rng: np.random.Generator) -> NDArray[np.float64]:
    picture = np.full(SHAPE, 90.0)
    cv2.circle(picture, (240, 150), 50, 180, -1)
    return picture + 3 * rng.standard_normal(SHAPE)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    "drawn",
    [noise, coloured_noise, brushed_plate, clouds, light_from_one_side, edge_of_a_plate, disc],
)
def test_no_width_to_trust_without_a_bead(drawn: Drawn, seed: int) -> None:
    pixels = np.clip(np.rint(drawn(np.random.default_rng(seed))), 0, 255).astype(np.uint8)
    photo = make_photo(pixels, drawn.__name__)
    try:
        result = measure_strip(photo, plane_of(photo, None))
    except (EvidenceError, ImageError) as error:
        assert drawn.__name__ in str(error)
    else:
        assert not result.trusted
        assert any("confidence is low" in warning for warning in result.warnings)


@pytest.mark.parametrize("level", [0, 120, 255])
def test_a_flat_picture_is_refused(level: int) -> None:
    photo = make_photo(np.full((200, 300, 3), level, np.uint8), "flat.png")
    with pytest.raises(EvidenceError, match=r"flat\.png"):
        measure_strip(photo, plane_of(photo, None))


def striped(width_px: int) -> NDArray[np.uint8]:
    rng = np.random.default_rng(0)
    picture = np.full((300, 500), 90.0)
    picture[140 : 140 + width_px] = 170
    picture = cv2.GaussianBlur(picture, (0, 0), 1.0) + 2 * rng.standard_normal(picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def test_too_few_pixels_across_are_refused() -> None:
    photo = make_photo(striped(6), "far.png")
    with pytest.raises((EvidenceError, ImageError), match=r"far\.png"):
        measure_strip(photo, plane_of(photo, None))


def test_few_pixels_across_are_a_warning() -> None:
    photo = make_photo(striped(20), "far.png")
    result = measure_strip(photo, plane_of(photo, None))
    assert np.median(result.width) == pytest.approx(20, abs=0.5)
    assert any("30 or more" in warning for warning in result.warnings)
    assert any("no calibration" in warning for warning in result.warnings)


def test_two_beads_are_doubted() -> None:
    picture = np.full((300, 500), 90.0)
    picture[60:100] = picture[200:240] = 170
    noisy = picture + 3 * np.random.default_rng(1).standard_normal(picture.shape)
    photo = make_photo(np.clip(noisy, 0, 255).astype(np.uint8), "two.png")
    result = measure_strip(photo, plane_of(photo, None))
    assert not result.trusted
    assert any("another band" in warning for warning in result.warnings)


@pytest.mark.parametrize(
    "scene",
    [
        replace(TINT, tint_mm=9, contrast=-40, ripple=3, specular=1.0),
        replace(TINT, blur_px=2.5),
        replace(TINT, tint_mm=3),
        replace(TINT, contrast=0, ripple=0),
    ],
    ids=["specular", "out of focus", "narrow tint", "smooth bead"],
)
def test_a_heat_tint_is_never_trusted_as_the_bead(scene: Scene) -> None:
    photo = make_photo(render(scene, 0).pixels, "tint.png")
    try:
        result = measure_strip(photo, plane_of(photo, None))
    except EvidenceError as error:
        assert "cannot be told" in str(error)
    else:
        assert not result.trusted
        assert any("heat tint" in warning for warning in result.warnings)


def film(rng: np.random.Generator, rough: float) -> NDArray[np.uint8]:
    """A dark stripe in a sharp band on a brushed plate; `rough` is the band's own detail."""
    picture = 110 + brushed(rng, (400, 640), 4)
    picture[120:280] -= 45
    picture[120:280] += rough * rng.standard_normal((160, 640))
    ripple = 12 * np.sin(np.arange(640) / 3)
    picture[185:215] = 45 + ripple + 12 * rng.standard_normal((30, 640))
    soft = cv2.GaussianBlur(picture, (0, 0), 1.0) + rng.standard_normal(picture.shape)
    return np.clip(np.rint(soft), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_band_as_smooth_as_the_plate_is_doubted_as_a_film(seed: int) -> None:
    photo = make_photo(film(np.random.default_rng(seed), rough=0), "film.png")
    result = measure_strip(photo, plane_of(photo, None))
    assert not result.trusted
    assert any("surface is as on the plate" in warning for warning in result.warnings)


def test_a_rough_band_is_a_bead_whatever_lies_on_it() -> None:
    photo = make_photo(film(np.random.default_rng(0), rough=25), "rough.png")
    result = measure_strip(photo, plane_of(photo, None))
    assert result.trusted
    assert np.median(result.width) == pytest.approx(160, abs=1)


def test_a_path_outside_the_photo_is_refused() -> None:
    bead = render(CASES["clean"], 0)
    photo = make_photo(bead.pixels, "clean.png")
    far = np.array([[500.0, 500.0], [600.0, 500.0]])
    with pytest.raises(EvidenceError, match="does not run through the photo"):
        measure_strip(photo, plane_of(photo, bead.calibration), far)
