"""Several photos of one bead: laid together where they surely overlap, refused where not."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from seamlog.analysis.bead.image import Photo, make_photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.stitch import backwards, stitch
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import Scene, SyntheticBead, render
from seamlog.calibration import PlaneCalibration, rows_of
from seamlog.errors import EvidenceError

SCENE = Scene(width_px=2000, height_px=360, noise=2, ripple=10, texture=6, spatter=60)


def crop(bead: SyntheticBead, first_px: int, seed: int) -> tuple[Photo, BeadMeasurement]:
    """A photo of 90 mm of the bead, with noise of its own."""
    noise = np.random.default_rng(seed).normal(0, 2, (bead.pixels.shape[0], 900))
    pixels = bead.pixels[:, first_px : first_px + 900] + noise
    photo = make_photo(np.clip(pixels, 0, 255).astype(np.uint8), f"photo{seed}.png")
    plane = PlaneCalibration(
        image_width_px=900,
        image_height_px=photo.height_px,
        plane_mm_from_px=rows_of(np.diag([0.1, 0.1, 1.0])),
        residual_mm=0.0,
        scale_relative_u=0.0,
    )
    return photo, measure_strip(photo, plane_of(photo, plane))


@pytest.fixture(scope="module")
def bead() -> SyntheticBead:
    return render(SCENE, 0)


def test_two_photos_become_one_bead(bead: SyntheticBead) -> None:
    (first, left), (second, right) = crop(bead, 0, 0), crop(bead, 700, 1)
    for photos, measured in (
        ((first, second), (left, right)),
        ((second, first), (right, left)),
    ):
        found = stitch(photos, measured)
        m = found.measurement
        assert np.ptp(m.s) == pytest.approx(160, abs=3)
        assert (np.diff(m.s) > 0).all()
        start = np.array([bead.calibration.plane_mm(left.centre_px[:1])[0]])
        true_mm = bead.width_at_mm(m.s[m.good] + bead.seam_s_mm(start)[0])
        assert np.sqrt(np.mean((m.width[m.good] - true_mm) ** 2)) < 0.08
        assert found.order == ((0, 1) if photos[0] is first else (1, 0))
        tall = found.photo.height_px
        assert tall == 2 * first.height_px
        assert m.centre_px[m.good][-1, 1] > first.height_px, "the second photo stands below"


def test_photos_that_share_nothing_are_not_stitched(bead: SyntheticBead) -> None:
    (first, left), (second, right) = crop(bead, 0, 0), crop(bead, 1050, 1)
    with pytest.raises(EvidenceError, match="photos 1 and 2"):
        stitch((first, second), (left, right))
    with pytest.raises(EvidenceError, match="no common scale"):
        stitch((first, second), (replace(left, unit="px"), right))
    bare = [replace(each, unit="px") for each in (left, right)]
    with pytest.raises(EvidenceError, match="only beads that can be trusted"):
        stitch((first, second), (bare[0], replace(bare[1], confidence=0.4)))
    with pytest.raises(EvidenceError, match="only marks that both photos show"):
        stitch((first, second), bare)


@pytest.mark.parametrize("turned", [False, True])
def test_photos_without_calibration_get_the_scale_of_the_first(
    bead: SyntheticBead, turned: bool
) -> None:
    first, far = crop(bead, 0, 0)[0], crop(bead, 500, 1)[0]
    pixels = cv2.resize(far.pixels, None, fx=0.8, fy=0.8, interpolation=cv2.INTER_AREA)
    second = make_photo(np.ascontiguousarray(np.rot90(pixels, 2 if turned else 0)), "far.png")
    left, right = (measure_strip(photo, plane_of(photo, None)) for photo in (first, second))
    m = stitch((first, second), (left, right)).measurement
    assert m.unit == "px"
    assert np.ptp(m.s) == pytest.approx(1400, abs=30)
    start = bead.seam_s_mm(bead.calibration.plane_mm(left.centre_px[:1]))[0]
    true_px = bead.width_at_mm(start + 0.1 * m.s) / 0.1
    error = (m.width - true_px)[m.good]
    assert (np.abs(error) < 3 * m.u_width[m.good]).mean() > 0.95
    first_u, second_u = np.median(m.u_width[:200]), np.median(m.u_width[-200:])
    assert second_u > first_u, "the scale of the second photo is less sure"
    assert np.sqrt(np.mean(error**2)) < 1.0


def test_backwards_twice_is_the_same(bead: SyntheticBead) -> None:
    _, measured = crop(bead, 0, 0)
    twice = backwards(backwards(measured))
    assert twice.s == pytest.approx(measured.s)
    assert np.array_equal(twice.left_px, measured.left_px)
    assert twice.starts_at == measured.starts_at
    assert backwards(measured).width[0] == measured.width[-1]
