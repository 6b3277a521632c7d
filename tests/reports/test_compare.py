"""`seamlog compare`: what became worse, by figures, limits and pairs, and with what certainty."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from seamlog.cli import run
from seamlog.errors import UnknownName, UsageError
from seamlog.reports.comparison import Comparison, compare_runs
from seamlog.reports.pairing import effective_count, mean_interval
from seamlog.reports.run import Run
from seamlog.reports.tolerances import read_tolerances
from seamlog.results import Criterion, Figure, Part, Results, Verdict
from tests.browsing import Visitor
from tests.reports.sample_results import START_NS, write_sample


def _results(folder: Path, **fields: object) -> Results:
    results = Results.create(folder)
    results.write(Part.model_validate({"part": "tracking", "title": "Tracking"} | fields))
    return results


def _rms(value: float | None, u: float | None = None) -> list[Figure]:
    return [Figure(name="rms_error_mm", label="rms error", value=value, unit="mm", u=u)]


def _compared(
    tmp_path: Path, base: dict[str, object], other: dict[str, object], *tolerance: str
) -> Comparison:
    runs = [
        Run(_results(tmp_path / name, **fields), number)
        for number, (name, fields) in enumerate({"base": base, "other": other}.items())
    ]
    return compare_runs(runs, read_tolerances(tolerance))


@pytest.mark.parametrize(
    ("base", "other", "tolerance", "verdict"),
    [
        ((1.0, None), (1.04, None), (), Verdict.PASS),
        ((1.0, None), (1.06, None), (), Verdict.FAIL),
        ((1.0, None), (1.06, None), ("10%",), Verdict.PASS),
        ((1.0, None), (1.06, None), ("10%", "rms_error_mm=0.05"), Verdict.FAIL),
        ((1.0, 0.03), (1.06, 0.03), (), Verdict.PASS),
        ((1.0, 0.01), (1.06, 0.01), (), Verdict.FAIL),
        ((1.0, None), (0.2, None), (), Verdict.PASS),
        ((0.0, None), (0.001, None), (), Verdict.FAIL),
    ],
)
def test_a_figure_regresses_beyond_tolerance_and_doubt(
    tmp_path: Path,
    base: tuple[float, float | None],
    other: tuple[float, float | None],
    tolerance: tuple[str, ...],
    verdict: Verdict,
) -> None:
    found = _compared(tmp_path, {"figures": _rms(*base)}, {"figures": _rms(*other)}, *tolerance)
    assert found.verdict is verdict
    assert bool(found.regressions) == (verdict is Verdict.FAIL)


@pytest.mark.parametrize("lost", [Verdict.FAIL, Verdict.NOT_MEASURABLE, None])
def test_a_limit_that_is_no_longer_met_or_known_is_a_regression(
    tmp_path: Path, lost: Verdict | None
) -> None:
    def limit(verdict: Verdict | None) -> dict[str, object]:
        met = [Criterion(name="peak", label="peak", value=1.0, verdict=verdict)] if verdict else []
        return {"criteria": met}

    found = _compared(tmp_path, limit(Verdict.PASS), limit(lost))
    assert found.verdict is Verdict.FAIL
    assert "limit on peak was met and is not any more in results 2" in found.regressions[0]


def test_what_is_not_known_any_more_is_said(tmp_path: Path) -> None:
    found = _compared(tmp_path, {"figures": _rms(1.0)}, {"figures": _rms(None)})
    assert found.unknown == ["tracking: rms error: not known in results 2"]


def test_nothing_in_common_is_no_verdict(tmp_path: Path) -> None:
    _results(tmp_path / "a", part="health")
    _results(tmp_path / "b", part="bead")
    assert run(["compare", str(tmp_path / "a"), str(tmp_path / "b")]) == 6


@pytest.mark.parametrize("text", ["x", "rms=", "-5%", "0.05", "nan%"])
def test_a_tolerance_that_makes_no_sense_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--tolerance"):
        read_tolerances([text])


def test_a_tolerance_of_a_figure_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match="Did you mean 'rms_error_mm'"):
        _compared(tmp_path, {"figures": _rms(1.0)}, {"figures": _rms(1.0)}, "rms_eror_mm=1")


def _alike(random: np.random.Generator, count: int, share: float) -> NDArray[np.float64]:
    """An autoregressive series of order 1 with standard deviation 1."""
    from scipy.signal import lfilter

    noise = random.normal(size=count + 200) * (1 - share**2) ** 0.5
    return np.asarray(lfilter([1.0], [1.0, -share], noise)[200:])


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9])
def test_effective_count_is_that_of_an_autoregressive_series(share: float) -> None:
    random = np.random.default_rng(1)
    found = [effective_count(_alike(random, 4000, share)) for _ in range(30)]
    assert np.median(found) == pytest.approx(4000 * (1 - share) / (1 + share), rel=0.15)


@pytest.mark.parametrize("share", [0.0, 0.8])
def test_the_interval_holds_the_truth_in_95_of_100(share: float) -> None:
    random = np.random.default_rng(2)
    held = 0
    for _ in range(400):
        interval = mean_interval(0.3 + _alike(random, 500, share))
        assert interval is not None
        held += interval[0] <= 0.3 <= interval[1]
    assert 0.91 <= held / 400 <= 0.98


def test_too_little_evidence_gives_no_interval() -> None:
    assert mean_interval(np.linspace(0.0, 1.0, 50)) is None


def test_pairs_at_the_same_moment_tell_a_small_growth(tmp_path: Path) -> None:
    """Each error grows by 10 %: the means' spread hides it, the pairs do not."""
    random = np.random.default_rng(3)
    stamps = START_NS + np.arange(3000) * 40_000_000
    error = random.normal(size=3000)
    runs = []
    for number, grown in enumerate((1.0, 1.1)):
        results = Results.create(tmp_path / str(number))
        columns = {"stamp_ns": stamps + number * 10**12, "error_mm": grown * error}
        results.write(Part(part="tracking", title="T"), tables={"error": (columns, {})})
        runs.append(Run(results, number))
    found = compare_runs(runs, read_tolerances([]))
    (item,) = found.paired
    assert item.mean == pytest.approx(0.1 * np.abs(error).mean())
    assert item.low is not None and item.low > 0.06
    assert "larger in results 2, pair by pair" in found.regressions[0]


def test_results_against_themselves_are_the_same(sample: Results) -> None:
    found = compare_runs([Run(sample, 0), Run(sample, 1)], read_tolerances([]))
    assert (found.verdict, found.regressions, found.unknown) == (Verdict.PASS, [], [])
    assert {item.mean for item in found.paired} == {0.0}
    assert len(set(found.labels)) == 2


def test_the_command_writes_page_markdown_and_json(
    sample: Results, tmp_path: Path, visitor: Visitor, capsys: pytest.CaptureFixture[str]
) -> None:
    worse = write_sample(tmp_path / "worse.results", seed=2)
    part = next(part for part in worse.parts() if part.part == "tracking")
    grown = part.figures[0].model_copy(update={"value": 0.9, "label": "rms <b>|`x"})
    changed = part.model_copy(update={"figures": [grown, *part.figures[1:]]})
    (worse.folder / "tracking.json").write_text(changed.model_dump_json())
    output = tmp_path / "compare.html"
    words = ["compare", str(sample.folder), str(worse.folder)]
    assert run([*words, "-o", str(output), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "FAIL" and len(told["regressions"]) == 1
    assert run([*words, "--md"]) == 1
    text = capsys.readouterr().out
    assert text.startswith("**FAIL**: 1 regression beyond the tolerance.")
    assert "0.9000 ± 0.0080 mm" in text
    visit = visitor.open(output)
    assert visit.complaints == []
    assert visit.page.locator("html").get_attribute("data-state") == "live"
    shown = visit.page.inner_text("main")
    assert "FAIL" in shown and "worse.results" in shown and "95 %" in shown
    assert visit.page.locator("#curves canvas").count() >= 8
    words_swapped = ["compare", str(worse.folder), str(sample.folder), "--md"]
    assert run(words_swapped) == 0
    assert "<b>" not in capsys.readouterr().out


def test_one_directory_without_replays_is_not_enough(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _results(tmp_path / "a")
    assert run(["compare", str(tmp_path / "a")]) == 2
    assert "or one with replays" in capsys.readouterr().err


def test_replays_of_one_session_are_set_beside_the_record(
    sample: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the sample the replayed pd has 2.4 times the recorded error, the paper's law 0.9."""
    words = ["compare", str(sample.folder), "--json", "-o", str(tmp_path / "c.html")]
    assert run(words) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["labels"] == ["recorded", "paper", "pd"]
    assert all("pd" in text and "paper" not in text for text in told["regressions"])
    means = {item["run"]: item for item in told["paired"] if item["column"] == "error_mm"}
    assert means["paper"]["high"] < 0 < means["pd"]["low"]
    assert "recorded" in (tmp_path / "c.html").read_text()
