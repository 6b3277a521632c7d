"""Limits and what was measured: PASS, FAIL, NOT MEASURABLE, NOT ASSESSED, each with its reason."""

from pathlib import Path

import numpy as np
import pytest

from seamlog.analysis.bead.part import BeadResult, bead_part
from seamlog.analysis.bead.uniformity import uniformity
from seamlog.analysis.quality.capability import capability, independent_count
from seamlog.analysis.quality.judge import judge
from seamlog.analysis.quality.part import Limit, QualityConfig, quality_part
from seamlog.analysis.quality.standard import Row, Sizes, limit_mm, load_standard
from seamlog.errors import ConfigError, InputError
from seamlog.results import Criterion, Figure, Part, Verdict
from tests.analysis.bead.test_results import made_up, result_of

WAVY = 6 + 0.1 * np.sin(2 * np.pi * 0.25 * np.arange(800) / 15)
RESULT = result_of(made_up(WAVY, noise=0.01))


@pytest.mark.parametrize(
    ("value", "verdict"),
    [
        (6.0, Verdict.PASS),
        (6.79, Verdict.PASS),
        (6.9, Verdict.NOT_MEASURABLE),
        (7.1, Verdict.NOT_MEASURABLE),
        (7.3, Verdict.FAIL),
        (4.7, Verdict.FAIL),
        (None, Verdict.NOT_MEASURABLE),
    ],
)
def test_the_guard_band(value: float | None, verdict: Verdict) -> None:
    assert judge(value, 0.1, 5.0, 7.0)[0] is verdict


def judged(config: QualityConfig, *more: Figure, result: BeadResult = RESULT) -> Part:
    figures = [*bead_part(result)[0].figures, *more]
    return quality_part(result, figures, config)


def row_of(part: Part, name: str) -> Criterion:
    return next(criterion for criterion in part.criteria if criterion.name == name)


def test_limits_of_a_drawing() -> None:
    limits = {
        "width_mm": Limit(lower=5.5, upper=6.5),
        "width_cv": Limit(upper=0.001),
        "width_mean_mm": Limit(lower=6.1),
    }
    part = judged(QualityConfig(limits=limits))
    assert row_of(part, "width_mm").verdict is Verdict.PASS
    assert row_of(part, "width_cv").verdict is Verdict.FAIL
    assert row_of(part, "width_mean_mm").verdict is Verdict.FAIL
    assert part.verdict is Verdict.FAIL
    assert part.figure("cpk") is not None


def test_one_wide_station_fails_with_its_place() -> None:
    width = WAVY.copy()
    width[400:404] = 6.9
    part = judged(
        QualityConfig(limits={"width_mm": Limit(upper=6.5)}), result=result_of(made_up(width))
    )
    row = row_of(part, "width_mm")
    assert row.verdict is Verdict.FAIL
    assert row.place is not None and row.place.s_mm == pytest.approx(100, abs=1)


def test_an_unknown_figure_is_a_fault_that_names_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="width_cv"):
        judged(QualityConfig(limits={"widht_cv": Limit(upper=1)}))


def test_without_millimetres_nothing_is_judged_in_millimetres() -> None:
    from dataclasses import replace

    pixels = replace(made_up(WAVY), unit="px")
    result = BeadResult(RESULT.photo, pixels, uniformity(pixels))
    limits = {"width_mm": Limit(upper=6.5), "width_mean_mm": Limit(upper=6.5)}
    part = judged(QualityConfig(limits=limits, level="C"), result=result)
    assert {c.verdict for c in part.criteria} <= {Verdict.NOT_MEASURABLE, Verdict.NOT_ASSESSED}
    assert row_of(part, "width_mean_mm").reason


def test_rows_of_the_standard_say_why_they_are_not_judged() -> None:
    part = judged(QualityConfig(level="C", weld="butt", plate_thickness_mm=8.0))
    assert row_of(part, "iso_100").verdict is Verdict.NOT_MEASURABLE
    assert "candidates only" in row_of(part, "iso_100").reason
    assert row_of(part, "iso_2017").verdict is Verdict.NOT_ASSESSED
    assert "penetration" in row_of(part, "iso_2017").reason
    undercut = row_of(part, "iso_5011_5012")
    assert (undercut.verdict, undercut.upper) == (Verdict.NOT_MEASURABLE, 0.5)
    assert not any(criterion.name == "iso_503" for criterion in part.criteria)
    assert any("513" in finding.message for finding in part.findings)
    assert not any("width" in c.label.lower() for c in part.criteria if "level" in c.label)


def test_a_laser_stripe_lets_rows_be_judged() -> None:
    config = QualityConfig(level="B", weld="butt", plate_thickness_mm=8.0)
    height = Figure(name="height_mm", label="Height", value=1.2, unit="mm", u=0.05)
    deep = Figure(name="undercut_depth_mm", label="Undercut", value=0.6, unit="mm", u=0.02)
    part = judged(config, height, deep)
    assert row_of(part, "iso_502").verdict is Verdict.PASS
    assert row_of(part, "iso_502").upper == pytest.approx(1.6, abs=0.02)
    assert row_of(part, "iso_5011_5012").verdict is Verdict.FAIL
    thin = judged(config.model_copy(update={"plate_thickness_mm": 2.0}), deep)
    assert row_of(thin, "iso_5011_5012").verdict is Verdict.NOT_ASSESSED


def test_verified_rows() -> None:
    rows = {row.number: row for row in load_standard().row}
    sizes = Sizes(t=20.0, s=8.0, b=12.0)

    def limits(number: str) -> list[float | None]:
        return [limit_mm(rows[number], level, sizes)[0] for level in ("D", "C", "B")]

    assert limits("100") == limits("104") == [0, 0, 0]
    assert limits("2017") == pytest.approx([2.4, 1.6, 0])
    assert limits("5011, 5012") == pytest.approx([1.0, 0.5, 0.5])
    assert limits("502") == pytest.approx([4.0, 2.8, 2.2])
    assert limits("503") == pytest.approx([4.0, 2.8, 2.2])


def test_a_table_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        'source = "drawing 7"\n[[row]]\nnumber = "x"\nname = "Spatter"\n'
        'figure = "spatter_count"\nlevels.C = { plus = 3.0 }\n'
    )
    count = Figure(name="spatter_count", label="Spatter", value=5, unit="1")
    part = judged(QualityConfig(level="C", table=path), count)
    assert row_of(part, "iso_x").verdict is Verdict.FAIL
    assert part.details["standard"] == "drawing 7"
    path.write_text("source = 1")
    with pytest.raises(ConfigError, match=r"own\.toml"):
        load_standard(path)
    with pytest.raises(InputError, match="nowhere"):
        load_standard(tmp_path / "nowhere.toml")


def test_a_level_that_the_table_lacks() -> None:
    row = Row(number="1", name="a", figure="b", levels={})
    assert limit_mm(row, "B", Sizes()) == (None, "the table has no level B for it")


def test_capability_and_its_interval_cover_the_truth() -> None:
    """Independent normal widths of known Cp 1.33: the interval holds it about 95 times in 100."""
    rng = np.random.default_rng(0)
    inside = 0
    for _ in range(200):
        width = 6 + 0.1 * rng.standard_normal(60)
        able = capability(width, float(np.std(width, ddof=1)), 5.6, 6.4)
        assert able is not None and able.cp_low is not None and able.cp_high is not None
        inside += able.cp_low <= 4 / 3 <= able.cp_high
    assert 0.85 < inside / 200 <= 1.0


def test_stations_that_are_alike_count_less() -> None:
    rng = np.random.default_rng(1)
    rough = rng.standard_normal(2000)
    smooth = np.convolve(rough, np.ones(20) / 20, mode="valid")
    assert independent_count(rough) > 1000
    assert independent_count(smooth) == pytest.approx(len(smooth) / 20, rel=0.4)
    assert capability(smooth[:10], 0.1, -1, 1) is None


def test_cpk_is_asked_for() -> None:
    limits = {"width_mm": Limit(lower=4.0, upper=8.0)}
    assert row_of(judged(QualityConfig(limits=limits, min_cpk=1.33)), "cpk").verdict is Verdict.PASS
    assert row_of(judged(QualityConfig(min_cpk=1.33)), "cpk").verdict is Verdict.NOT_MEASURABLE
