"""Real photos: human contours of MAG beads, and messy photos that must not give millimetres."""

import csv
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from seamlog.analysis.bead.assess import AssessedPhoto, assess_photos
from seamlog.analysis.bead.image import load_photo
from seamlog.analysis.bead.measurement import TRUSTED, BeadMeasurement
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.sources import photo_files
from seamlog.analysis.bead.strip import measure_strip

MEDIAN_ERROR = 0.05
WITHIN_5_PERCENT = 9
"""Of 17; people who drew such contours differ by up to 15 %."""
WORST_TRUSTED = 0.25
TINTED = ("149", "161", "194", "25")
"""Repair welds in the heat tint of stainless steel."""


@cache
def assessed(path: Path) -> AssessedPhoto:
    return assess_photos(photo_files((path,), None))[0]


@pytest.fixture(scope="module")
def human_widths(data_dir: Path) -> Iterator[dict[Path, float]]:
    folder = data_dir / "bead_contours"
    with (folder / "ground_truth.csv").open() as file:
        rows = list(csv.DictReader(file))
    yield {folder / f"{row['image']}.jpg": float(row["gt_mean_width_px"]) for row in rows}


def relative_errors(human_widths: dict[Path, float]) -> dict[Path, tuple[float, float]]:
    """Error of the mean width against the human one, and the confidence it came with."""
    found = {}
    for path, human_px in human_widths.items():
        document = assessed(path).summary()
        if document["refused"] is None:
            error = document["mean_width_px"] / human_px - 1
            found[path] = (error, document["confidence"])
    return found


def test_mean_width_of_real_beads(human_widths: dict[Path, float]) -> None:
    errors = relative_errors(human_widths)
    assert len(human_widths) == 17
    assert len(errors) >= 15
    size = np.abs([error for error, _ in errors.values()])
    assert np.median(size) <= MEDIAN_ERROR
    assert (size <= 0.05).sum() >= WITHIN_5_PERCENT


def test_no_trusted_width_is_far_off(human_widths: dict[Path, float]) -> None:
    for path, (error, confidence) in relative_errors(human_widths).items():
        assert abs(error) <= WORST_TRUSTED or confidence < TRUSTED, path.stem


def measured_along_its_middle(path: Path) -> BeadMeasurement:
    """The bead measured along the middle of what is found without a path, which wanders."""
    photo = load_photo(path)
    plane = plane_of(photo, None)
    found = measure_strip(photo, plane)
    middle = found.centre_px[:: len(found.centre_px) // 40]
    wander = 0.12 * found.width[found.good].mean() * np.sin(np.linspace(0, 9, len(middle)))
    return measure_strip(photo, plane, middle + wander[:, None] * (0.3, 1.0))


def test_a_given_path_leads_to_the_same_bead(human_widths: dict[Path, float]) -> None:
    """Beads that fill a fifth to two fifths of the photo, and paths that wander in them."""
    errors = []
    for path, human_px in human_widths.items():
        given = measured_along_its_middle(path)
        error = given.width[given.good].mean() / human_px - 1
        assert abs(error) <= WORST_TRUSTED or not given.trusted, path.stem
        errors.append(abs(error))
    assert np.median(errors) <= MEDIAN_ERROR


@pytest.mark.parametrize("name", TINTED)
def test_a_heat_tint_along_a_given_path_is_not_trusted(data_dir: Path, name: str) -> None:
    assert not measured_along_its_middle(data_dir / "bead_photos" / f"{name}.jpg").trusted


def test_messy_photos_never_give_millimetres(data_dir: Path) -> None:
    photos = sorted((data_dir / "bead_photos").glob("*.jpg"))
    photos += sorted((data_dir / "bead_bam").glob("*.JPG"))
    assert len(photos) == 8
    for path in photos:
        item = assessed(path)
        document = item.summary()
        assert not any(key.endswith("_mm") for key in document), path.name
        assert not any(figure.unit == "mm" for figure in item.part.figures)
        if document["refused"] is None:
            assert any("no calibration" in warning for warning in document["warnings"])


def test_a_plate_before_welding_has_no_trusted_width(data_dir: Path) -> None:
    for path in (data_dir / "bead_bam" / "WID417_pre.JPG", *(data_dir / "seam").glob("*.png")):
        document = assessed(path).summary()
        assert document["refused"] or document["confidence"] < TRUSTED, path.name


def test_a_heat_tint_is_not_trusted_as_a_bead(data_dir: Path) -> None:
    tinted = [data_dir / "bead_photos" / f"{name}.jpg" for name in TINTED]
    for path in (*tinted, data_dir / "bead_bam" / "WID417_post.JPG"):
        document = assessed(path).summary()
        assert document["refused"] or document["confidence"] < TRUSTED, path.name
