"""Spatter: found, counted, sized, and told from what was there before."""

import numpy as np
import pytest

from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.synthetic import Scene
from seamlog.analysis.surface.blobs import find_blobs
from seamlog.analysis.surface.spatter import find_spatter
from seamlog.analysis.surface.synthetic_spatter import matched, spattered
from seamlog.errors import EvidenceError

PLAIN = Scene(width_px=640, noise=2)
TEXTURED = Scene(width_px=640, noise=2, texture=8, haz=35, gradient=0.4)


@pytest.mark.parametrize(("scene", "least"), [(PLAIN, 0.95), (TEXTURED, 0.92)])
def test_drops_are_found_on_plain_and_textured_plate(scene: Scene, least: float) -> None:
    scores = []
    for seed in (0, 1):
        case = spattered(scene, 40, seed)
        found = find_spatter(case.photo, case.plane, case.bead)
        hits = matched(found.blobs.x_px, found.blobs.y_px, case.drops)
        scores.append(2 * hits / (len(found.blobs) + len(case.drops)))
    assert np.mean(scores) >= least


def test_size_and_distance_of_drops() -> None:
    case = spattered(PLAIN, 30, 4)
    found = find_spatter(case.photo, case.plane, case.bead)
    for x, y, radius, contrast in case.drops:
        away = np.hypot(found.blobs.x_px - x, found.blobs.y_px - y)
        at = int(np.argmin(away))
        if away[at] < 1.0 and radius > 2.5:
            assert found.diameter[at] == pytest.approx(0.2 * radius, abs=0.12)
            assert found.blobs.contrast[at] * contrast > 0
    assert found.distance.min() >= 0
    assert found.distance.max() < 11
    assert found.area.sum() == pytest.approx(
        np.pi * np.sum((0.1 * case.drops[:, 2]) ** 2), rel=0.15
    )


def test_a_plate_without_spatter_has_none() -> None:
    case = spattered(TEXTURED, 0, 3)
    assert len(find_spatter(case.photo, case.plane, case.bead).blobs) <= 1


def test_marks_from_before_welding_do_not_count() -> None:
    """Half of the drops are on the photo from before, which was taken a little aside."""
    case = spattered(Scene(width_px=800, noise=2, texture=6), 40, 7)
    before = np.roll(case.photo.pixels, (6, -9), axis=(0, 1)).copy()
    hidden = before.shape[1] // 2
    before[:, hidden:] = np.roll(case.clean.pixels, (6, -9), axis=(0, 1))[:, hidden:]
    found = find_spatter(case.photo, case.plane, case.bead, make_photo(before, "before"))
    assert found.known_before is not None
    left = case.drops[:, 0] < hidden
    assert found.known_before == pytest.approx(left.sum(), abs=3)
    assert len(found.blobs) == pytest.approx((~left).sum(), abs=4)


def test_a_photo_of_something_else_cannot_be_the_one_from_before() -> None:
    case = spattered(PLAIN, 10, 7)
    other = np.random.default_rng(0).integers(0, 255, case.photo.pixels.shape, np.uint8)
    with pytest.raises(EvidenceError, match="other cannot be laid over plate"):
        find_spatter(case.photo, case.plane, case.bead, make_photo(other, "other"))


def test_streaks_and_edges_are_no_blobs() -> None:
    picture = np.full((200, 300), 90, np.float32)
    picture[60:64, 40:200] = 160
    picture[:, 250:] = 30
    picture += np.random.default_rng(0).normal(0, 2, picture.shape).astype(np.float32)
    inside = np.ones(picture.shape, dtype=bool)
    assert len(find_blobs(picture, inside, 1.5, 8)) == 0
    assert len(find_blobs(picture, np.zeros_like(inside), 1.5, 8)) == 0


def test_a_picture_that_shows_a_part_only_cannot_tell_what_was_there() -> None:
    case = spattered(Scene(width_px=800, noise=2, texture=6), 40, 7)
    part = make_photo(case.photo.pixels[:, :500].copy(), "half")
    with pytest.raises(EvidenceError, match=r"half shows \d\d % of .* only"):
        find_spatter(case.photo, case.plane, case.bead, part)
