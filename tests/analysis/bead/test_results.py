"""From a measurement to figures, criteria, findings and files."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from seamlog.analysis.bead.assess import assess_photos
from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.part import BeadConfig, BeadResult, bead_part, gaps
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.sources import PhotoSource, photo_files
from seamlog.analysis.bead.synthetic import CASES, Scene, render
from seamlog.analysis.bead.uniformity import uniformity
from seamlog.calibration import ScaleCalibration
from seamlog.errors import CalibrationError
from seamlog.results import Results, Verdict


def made_up(width: np.ndarray, noise: float = 0.0) -> BeadMeasurement:
    """A straight bead of these widths, stations 0.25 mm apart."""
    count = len(width)
    s = 0.25 * np.arange(count, dtype=np.float64)
    centre = np.column_stack([10 * s + 20, np.full(count, 100.0)])
    across = np.column_stack([np.zeros(count), 5 * width])
    noisy = width + noise * np.random.default_rng(0).standard_normal(count)
    return BeadMeasurement(
        unit="mm",
        s=s,
        width=noisy,
        u_width=np.full(count, np.hypot(noise, 0.02)),
        u_noise=np.full(count, noise),
        left_px=centre - across,
        right_px=centre + across,
        centre_px=centre,
        flagged=np.zeros(count, dtype=bool),
        reason=("",) * count,
        unit_per_px=0.1,
        confidence=0.9,
        warnings=(),
        starts_at="left",
        direction_known=True,
        open_start=False,
        open_stop=False,
    )


def result_of(measurement: BeadMeasurement) -> BeadResult:
    photo = make_photo(np.full((200, 2100), 90, np.uint8), "made/up.png")
    return BeadResult(photo, measurement, uniformity(measurement))


WAVY = 6 + 0.3 * np.sin(2 * np.pi * 0.25 * np.arange(800) / 40)


def test_noise_is_taken_out_of_the_spread() -> None:
    even = uniformity(made_up(WAVY, noise=0.4))
    assert even is not None
    assert even.std == pytest.approx(np.std(WAVY), rel=0.1)
    assert even.cv == pytest.approx(even.std / even.mean)


def test_peak_to_peak_within_25_mm() -> None:
    slow = uniformity(made_up(6 + 0.01 * 0.25 * np.arange(800)))
    assert slow is not None
    assert slow.peak_to_peak_25mm == pytest.approx(0.25, abs=0.015)
    short = uniformity(made_up(WAVY[:80]))
    assert short is not None
    assert short.peak_to_peak_25mm is None


def test_flagged_stations_do_not_count() -> None:
    measurement = made_up(WAVY)
    wide = measurement.width.copy()
    wide[100:110] = 60
    flagged = np.zeros(len(wide), dtype=bool)
    flagged[100:110] = True
    reason = tuple("left toe strays" if flag else "" for flag in flagged)
    even = uniformity(replace(measurement, width=wide, flagged=flagged, reason=reason))
    assert even is not None
    assert even.mean == pytest.approx(6, abs=0.02)
    assert gaps(replace(measurement, flagged=flagged, reason=reason)) == [
        (100, 109, "left toe strays")
    ]


def test_limits_give_criteria_with_a_guard_band() -> None:
    result = result_of(made_up(WAVY))
    wide, _, _ = bead_part(result, config=BeadConfig(min_width_mm=5, max_width_mm=7))
    near, _, _ = bead_part(result, config=BeadConfig(max_width_mm=6.32))
    assert wide.verdict is Verdict.PASS
    assert near.verdict is Verdict.NOT_MEASURABLE, "6.3 mm, U = 0.04 mm: neither shown for 6.32 mm"
    over, _, _ = bead_part(result, config=BeadConfig(max_width_mm=6.2))
    assert over.verdict is Verdict.FAIL
    place = near.criteria[0].place
    assert place is not None and place.s_mm is not None
    assert place.s_mm % 40 == pytest.approx(10, abs=0.3), "a crest of the wave"


def test_a_doubtful_width_is_not_judged() -> None:
    result = result_of(replace(made_up(WAVY), confidence=0.3))
    part, _, _ = bead_part(result, config=BeadConfig(max_width_mm=7))
    assert part.verdict is Verdict.NOT_MEASURABLE
    assert "0.30" in part.reason


def test_without_limits_nothing_is_judged() -> None:
    part, _, _ = bead_part(result_of(made_up(WAVY)))
    assert part.verdict is Verdict.NOT_ASSESSED
    assert part.criteria == []


def test_a_part_goes_to_files_and_back(tmp_path: Path) -> None:
    result = result_of(made_up(WAVY))
    results = Results.create(tmp_path / "r")
    written = results.write(*bead_part(result, weld=2))
    columns = results.columns(written, "stations")
    assert columns["width_mm"] == pytest.approx(result.measurement.width)
    assert written.tables["stations"].columns["left_x_px"] == "px"
    picture = cv2.imdecode(np.frombuffer(results.picture(written, "overlay"), np.uint8), 1)
    assert picture is not None
    shown = written.pictures["overlay"]
    assert picture.shape[:2] == (shown.height_px, shown.width_px)
    assert (picture[..., 1].astype(int) - picture[..., 2] > 60).any(), "toes drawn in green"


@pytest.fixture(scope="module")
def small() -> tuple[PhotoSource, PhotoSource]:
    bead = render(Scene(width_px=512, height_px=300, noise=3), 1)
    photo = make_photo(bead.pixels, "bead.png")
    return PhotoSource(photo, bead.calibration, ()), PhotoSource(photo, None, ())


def test_millimetres_need_a_calibration(small: tuple[PhotoSource, PhotoSource]) -> None:
    calibrated, bare = assess_photos(small)
    assert calibrated.summary()["mean_width_mm"] == pytest.approx(6, abs=0.3)
    document = bare.summary()
    assert document["mean_width_px"] == pytest.approx(60, abs=3)
    assert document["peak_to_peak_25mm"] is None
    assert not any(key.endswith("_mm") for key in document)
    assert not any(figure.unit == "mm" for figure in bare.part.figures)
    assert not any("mm" in column for column in bare.part.tables)


def test_the_other_definition_of_the_toe_is_told_beside(
    small: tuple[PhotoSource, PhotoSource],
) -> None:
    metal, outer = (
        assess_photos(small[:1], config=BeadConfig(toe=toe))[0] for toe in ("metal", "outer")
    )
    for one, other, name in ((metal, outer, "outer"), (outer, metal, "metal")):
        document = one.summary()
        assert document["other_toe"] == name
        assert document["mean_width_by_other_toe"] == other.summary()["mean_width_mm"]
        (beside,) = (f for f in one.part.figures if f.name == f"width_mean_{name}_toe_mm")
        assert (beside.value, beside.u) == (
            document["mean_width_by_other_toe"],
            other.summary()["u_mean_width"],
        )


def test_a_known_scale_is_enough_for_millimetres(small: tuple[PhotoSource, PhotoSource]) -> None:
    scale = ScaleCalibration(
        image_width_px=512, image_height_px=300, mm_per_px=0.1, scale_relative_u=0.04
    )
    found = assess_photos([PhotoSource(small[1].photo, scale, ())])[0].summary()
    assert found["mean_width_mm"] == pytest.approx(6, abs=0.3)
    assert found["u_mean_width"] == pytest.approx(0.04 * found["mean_width_mm"], rel=0.1)


def test_a_refused_photo_keeps_its_place(small: tuple[PhotoSource, PhotoSource]) -> None:
    flat = PhotoSource(make_photo(np.full((200, 300), 90, np.uint8), "flat.png"), None, ())
    first, second = assess_photos([flat, small[0]])
    assert first.refusal is not None
    assert first.part.verdict is Verdict.NOT_MEASURABLE
    assert first.part.figures[0].value is None
    assert (first.part.index, second.part.index) == (1, 2)


def test_calibration_of_another_size_is_refused(small: tuple[PhotoSource, PhotoSource]) -> None:
    other = render(Scene(width_px=256, height_px=160), 0).calibration
    with pytest.raises(CalibrationError, match="512 x 300"):
        plane_of(small[0].photo, other)


def test_calibration_beside_the_photo_is_taken(tmp_path: Path) -> None:
    bead = render(CASES["clean"], 0)
    cv2.imwrite(str(tmp_path / "weld.bead.png"), bead.pixels)
    file = tmp_path / "weld.bead.calibration.json"
    file.write_text(bead.calibration.model_dump_json(by_alias=True))
    source = photo_files((tmp_path / "weld.bead.png",), None)[0]
    assert source.calibration == bead.calibration
    assert [item.name for item in source.inputs] == ["weld.bead.png", file.name]
