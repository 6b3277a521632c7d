"""Widths of rendered beads against their exact truth."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.measurement import TOES
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import CASES, Scene, render
from seamlog.analysis.bead.uniformity import uniformity

from .conftest import Measured

MeasureCase = Callable[[str, int, bool], Measured]

RMS_PX = {
    "clean": 0.06,
    "snr 20": 0.075,
    "snr 5": 0.29,
    "blur 3": 0.24,
    "ripple": 0.65,
    "haz + texture": 0.3,
    "specular": 0.99,
    "dark toe": 0.29,
    "low contrast": 1.5,
    "spatter": 0.13,
    "perspective": 0.1,
    "hard": 0.99,
}


@pytest.mark.parametrize("name", list(CASES))
def test_width_along_a_given_path(measure_case: MeasureCase, name: str) -> None:
    measured = measure_case(name, 3, True)
    error = measured.error_px
    lost = ~(np.abs(error) <= 5)
    flagged = ~measured.result.good[measured.inside]
    assert len(error) > 350
    assert not (lost & ~flagged).any(), "lost silently"
    assert flagged.mean() <= (0.05 if name == "low contrast" else 0.02)
    assert np.sqrt(np.mean(error[~lost] ** 2)) <= RMS_PX[name]


@pytest.mark.parametrize("name", ["clean", "snr 5", "spatter", "hard"])
def test_width_with_the_path_found_in_the_photo(measure_case: MeasureCase, name: str) -> None:
    measured = measure_case(name, 4, False)
    error = measured.error_px
    silent = ~(np.abs(error) <= 5) & measured.result.good[measured.inside]
    assert not silent.any()
    assert np.sqrt(np.nanmean(error**2)) <= 1.2 * RMS_PX[name]
    assert measured.result.trusted


def test_a_dark_band_beside_the_bead_is_not_taken_for_it(measure_case: MeasureCase) -> None:
    measured = measure_case("haz + texture", 5, False)
    assert np.median(np.abs(measured.error_px)) <= RMS_PX["haz + texture"]


@pytest.mark.parametrize("toe", list(TOES))
def test_a_bead_partly_out_of_the_photo_is_measured_where_it_is_inside(toe: str) -> None:
    bead = render(CASES["clean"], 0)
    photo = make_photo(bead.pixels[200:], "frame.png")
    result = measure_strip(photo, plane_of(photo, None), toe=toe)
    assert result.toe_definition.startswith(toe)
    in_table = plane_of(make_photo(bead.pixels, "whole.png"), bead.calibration)
    whole_px = result.centre_px[result.good] + (0, 200)
    true_px = bead.width_at_mm(bead.seam_s_mm(in_table.to_plane(whole_px))) / 0.1
    assert np.median(np.abs(result.width[result.good] - true_px)) <= 0.2
    assert 0.1 < result.flagged.mean() < 0.5
    assert any("frame" in reason for reason in result.reason)


@pytest.mark.parametrize("name", ["snr 20", "snr 5", "blur 3"])
def test_uncertainty_covers_the_error(measure_case: MeasureCase, name: str) -> None:
    measured = measure_case(name, 3, True)
    u_px = measured.result.u_width[measured.inside] / 0.1
    covered = np.abs(measured.error_px) <= 1.96 * u_px
    assert 0.85 <= covered.mean() <= 0.995


@pytest.mark.parametrize("name", ["snr 5", "blur 3"])
def test_noise_does_not_pass_for_unevenness(measure_case: MeasureCase, name: str) -> None:
    measured = measure_case(name, 3, True)
    even = uniformity(measured.result)
    true_mm = measured.bead.width_at_mm(
        measured.bead.seam_s_mm(measured.plane.to_plane(measured.result.centre_px))
    )
    assert even is not None
    assert even.std == pytest.approx(np.std(true_mm), rel=0.06)
    assert even.mean == pytest.approx(np.mean(true_mm), abs=0.02)


def test_a_gap_is_flagged_with_its_reason() -> None:
    bead = render(Scene(gaps=1, noise=4), 2)
    photo = make_photo(bead.pixels, "gap")
    plane = plane_of(photo, bead.calibration)
    result = measure_strip(photo, plane, bead.wandering_path())
    s_mm = bead.seam_s_mm(plane.to_plane(result.centre_px))
    first, last = bead.gaps_mm[0]
    within = (s_mm > first + 0.5) & (s_mm < last - 0.5)
    away = (s_mm < first - 2) | (s_mm > last + 2)
    inside = (s_mm > 4) & (s_mm < 98)
    assert result.flagged[within].all()
    assert any("no bead" in text or "toe" in text for text in np.array(result.reason)[within])
    assert result.flagged[away & inside].mean() < 0.03


def test_stations_lie_a_quarter_millimetre_apart(measure_case: MeasureCase) -> None:
    measured = measure_case("clean", 3, True)
    centre_mm = measured.plane.to_plane(measured.result.centre_px)
    steps = np.hypot(*np.diff(centre_mm, axis=0).T)[20:-20]
    assert np.diff(measured.result.s) == pytest.approx(0.25)
    assert np.median(steps) == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize("mm_per_px", [0.1, 0.05])
def test_what_averaging_takes_of_ripples_is_in_the_uncertainty(mm_per_px: float) -> None:
    """Scalloped toes 0.9 mm long: what is lost of them is several times the noise."""
    scene = replace(CASES["ripple"], width_px=1024, height_px=512, mm_per_px=mm_per_px)
    bead = render(scene, 1)
    photo = make_photo(bead.pixels, "ripple")
    plane = plane_of(photo, bead.calibration)
    result = measure_strip(photo, plane, bead.wandering_path(seed=1))
    centre_mm = plane.to_plane(result.centre_px)
    inside = (centre_mm[:, 0] > 3) & (centre_mm[:, 0] < 1024 * mm_per_px - 3)
    error = (result.width - bead.width_at_mm(bead.seam_s_mm(centre_mm)))[inside]
    u = result.u_width[inside]
    assert (np.abs(error) <= 1.96 * u).mean() > 0.8
    assert (np.abs(error) <= 5 * u).all()
