"""The first screen: what would have helped; the place that matters, by photo and camera."""

from pathlib import Path
from typing import Any

import pytest

from seamlog.reports.advice import advice
from seamlog.reports.moment import moment_of
from seamlog.reports.run import Run
from seamlog.results import Figure, Part, Results
from tests.reports.sample_results import OFFSET_MM, SLOW_S_MM, write_sample


def _advice(folder: Path, *parts: Part) -> list[str]:
    results = Results.create(folder)
    for part in parts:
        results.write(part)
    return advice([Run(Results.open(folder), 0)])


def _replay(**rms: tuple[float, float]) -> Part:
    figures = [
        Figure(name=f"{name}_rms_error_mm", label=name, value=value, u=u, unit="mm")
        for name, (value, u) in rms.items()
    ]
    return Part(part="replay", title="Replay", figures=figures)


def test_a_controller_that_is_better_beyond_doubt_is_recommended(tmp_path: Path) -> None:
    (text,) = _advice(tmp_path / "r", _replay(recorded=(0.5, 0.0), lqr=(0.2, 0.01), pd=(0.9, 0.01)))
    assert text.startswith("Another controller, lqr: rms tracking error lqr 0.200 ± 0.020 mm")
    assert "the recorded one 0.5 mm" in text


@pytest.mark.parametrize("lqr", [(0.48, 0.02), (0.7, 0.0)])
def test_a_controller_within_the_doubt_is_not(tmp_path: Path, lqr: tuple[float, float]) -> None:
    (text,) = _advice(tmp_path / "r", _replay(recorded=(0.5, 0.0), lqr=lqr))
    assert text.startswith("Not another controller: the one replayed tracks no better")


def test_the_prediction_of_the_recorded_controller_is_what_others_are_set_beside(
    tmp_path: Path,
) -> None:
    """A model that flatters every controller alike must not recommend one."""
    replay = _replay(recorded=(0.5, 0.0), recorded_predicted=(0.3, 0.01), pd=(0.3, 0.01))
    assert "Not another controller" in _advice(tmp_path / "r", replay)[0]


@pytest.mark.parametrize(
    "details",
    [{}, {"causes": None}, {"causes": "x"}, {"causes": [3, {"channel": 4}, {"channel": "speed"}]}],
)
def test_without_a_cause_nothing_is_advised(tmp_path: Path, details: dict[str, Any]) -> None:
    assert _advice(tmp_path / "r", Part(part="join", title="Join", details=details)) == []


def test_the_sample_is_told_to_hold_its_speed(sample: Results) -> None:
    first = advice([Run(sample, 0)])[0]
    assert (
        first == "A steady weld speed near s = 120.0 mm: the width there goes with it, r = −0.96."
    )


def test_the_moment_is_that_of_the_finding(sample: Results) -> None:
    moment = moment_of(Run(sample, 0))
    assert moment is not None and moment.photo is not None and moment.frame is not None
    assert moment.frame.seconds == pytest.approx(50.0)  # nearest picture to 50.5 s
    assert moment.frames_id == "frames-0-seam"
    (mark,) = moment.photo.marks
    assert (mark.x1_px + mark.x2_px) / 2 == pytest.approx(40 + 10 * (SLOW_S_MM + OFFSET_MM), abs=3)


def test_without_join_the_failed_place_is_shown_and_no_camera(tmp_path: Path) -> None:
    results = write_sample(tmp_path / "r")
    (tmp_path / "r" / "join.json").unlink()
    moment = moment_of(Run(results, 0))
    assert moment is not None and moment.photo is not None
    assert moment.frame is None
    assert "on the photo" in moment.photo.marks[0].label


def test_a_good_weld_shows_its_widest_place(tmp_path: Path) -> None:
    results = write_sample(tmp_path / "r")
    (tmp_path / "r" / "join.json").unlink()
    bead = next(part for part in results.parts() if part.part == "bead")
    good = bead.model_copy(update={"criteria": []})
    (tmp_path / "r" / "bead.json").write_text(good.model_dump_json())
    moment = moment_of(Run(results, 0))
    assert moment is not None and moment.photo is not None
    assert moment.photo.marks[0].label == "the widest place"


def test_no_picture_no_moment(tmp_path: Path) -> None:
    results = Results.create(tmp_path / "r")
    results.write(Part(part="health", title="Health"))
    assert moment_of(Run(results, 0)) is None
