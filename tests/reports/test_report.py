"""The builder: same bytes, honest verdicts, nothing missing without a word."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from seamlog.errors import ResultsError
from seamlog.reports import page
from seamlog.reports.content import Banner, Notice, Text
from seamlog.reports.curves import Plot
from seamlog.reports.report import Report
from seamlog.results import Criterion, Figure, Input, Part, Place, Results, Verdict
from tests.reports.sample_results import write_sample


def _report(*folders: Results) -> Report:
    report = Report()
    for results in folders:
        report.add_results(results)
    return report


def _one_part(folder: Path, **fields: object) -> Results:
    results = Results.create(folder)
    base: dict[str, object] = {"part": "tracking", "title": "Tracking"}
    results.write(Part.model_validate(base | fields))
    return results


def _banner(report: Report) -> Banner:
    block = report.document().sections[0].blocks[0]
    assert isinstance(block, Banner)
    return block


def test_same_results_give_same_bytes(tmp_path: Path, sample_page: Path) -> None:
    again = write_sample(tmp_path / "elsewhere")
    _report(again).write(tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == sample_page.read_bytes()


def test_other_results_have_another_id(tmp_path: Path, sample: Results) -> None:
    other = write_sample(tmp_path / "other", seed=2)
    assert _report(other).document().id != _report(sample).document().id


def test_the_date_is_the_end_of_the_weld_or_unknown(tmp_path: Path, sample: Results) -> None:
    assert _report(sample).document().date == "2026-01-01"
    assert _report(_one_part(tmp_path / "r")).document().date is None
    assert Report(date="2026-02-03").document().date == "2026-02-03"


def test_a_missing_part_is_named(tmp_path: Path) -> None:
    document = _report(_one_part(tmp_path / "r")).document()
    for section in document.sections:
        if section.name in (
            "bead",
            "quality",
            "surface",
            "join",
            "seam",
            "replay",
            "identification",
            "health",
        ):
            assert isinstance(section.blocks[0], Notice)
            assert "not recorded" in section.blocks[0].text
    text = page.render(document)
    assert "none; nothing was judged" in text
    assert text.count("(not recorded)") == 8


@pytest.mark.parametrize(
    ("verdicts", "overall"),
    [
        ([], Verdict.NOT_ASSESSED),
        ([Verdict.NOT_ASSESSED], Verdict.NOT_ASSESSED),
        ([Verdict.NOT_MEASURABLE], Verdict.NOT_ASSESSED),
        ([Verdict.PASS, Verdict.NOT_ASSESSED], Verdict.PASS),
        ([Verdict.PASS, Verdict.NOT_MEASURABLE], Verdict.PASS),
        ([Verdict.PASS, Verdict.FAIL, Verdict.NOT_ASSESSED], Verdict.FAIL),
    ],
)
def test_overall_verdict(tmp_path: Path, verdicts: list[Verdict], overall: Verdict) -> None:
    results = Results.create(tmp_path / "r")
    results.write(Part(part="health", title="Health"))
    for index, verdict in enumerate(verdicts, 1):
        results.write(Part(part="bead", index=index, title=f"Bead {index}", verdict=verdict))
    banner = _banner(_report(results))
    assert banner.verdict is overall
    unknown = [s for s in banner.statements if s.verdict is Verdict.NOT_ASSESSED]
    assert {"Health", "Replay"} <= {statement.subject for statement in unknown}


def test_a_failed_limit_is_the_reason(tmp_path: Path) -> None:
    criterion = Criterion(
        name="peak", label="peak error", value=0.9, unit="mm", u=0.01, upper=0.5, verdict="FAIL"
    )
    results = _one_part(tmp_path / "r", verdict="FAIL", criteria=[criterion])
    reasons = [line.message for line in _banner(_report(results)).reasons]
    assert reasons == ["peak error: 0.900 ± 0.020 mm (limit at most 0.5 mm)"]


def test_a_part_that_no_section_knows_is_shown(tmp_path: Path) -> None:
    results = Results.create(tmp_path / "r")
    table = {"stamp_ns": np.arange(9) * 10**9, "value": np.arange(9.0)}
    figure = Figure(name="n", label="porosity", value=3)
    part = Part(part="x ray", title="X-ray", figures=[figure])
    results.write(part, tables={"trace": (table, {})})
    section = next(s for s in _report(results).document().sections if s.name == "x-ray")
    assert any(isinstance(block, Plot) for block in section.blocks)
    assert "porosity" in page.render(_report(results).document())


def test_changed_tables_are_refused(tmp_path: Path) -> None:
    results = write_sample(tmp_path / "r")
    table = tmp_path / "r" / "tracking.error.parquet"
    table.write_bytes(table.read_bytes() + b"x")
    with pytest.raises(ResultsError, match="changed after the analysis"):
        _report(results).document()


def test_two_results_stand_side_by_side(tmp_path: Path, sample: Results) -> None:
    inputs = [Input(name="second.mcap", sha256="0" * 64, bytes=1)]
    other = _one_part(tmp_path / "second", inputs=inputs)
    document = _report(sample, other).document()
    assert document.subject == "weld.mcap, second.mcap"
    ids = [block.id for s in document.sections for block in s.blocks if isinstance(block, Plot)]
    assert len(ids) == len(set(ids))
    text = page.render(document)
    assert "second.mcap: Bead" in text
    bead = next(section for section in document.sections if section.name == "bead")
    assert isinstance(bead.blocks[-1], Notice)
    assert bead.blocks[-1].reason == "The results of second.mcap hold no such part."


def test_the_json_twin_is_what_the_page_shows(sample: Results, sample_page: Path) -> None:
    text = sample_page.read_text()
    found = re.search(r'id="seamlog-report">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    twin = json.loads(found[1])
    assert (twin["schema"], twin["verdict"], twin["date"]) == (
        "seamlog.report",
        "FAIL",
        "2026-01-01",
    )
    figures = [b for s in twin["sections"] for b in s["blocks"] if b["kind"] == "figures"]
    inertia = next(f for b in figures for f in b["figures"] if f["name"] == "inertia")
    part = next(part for part in sample.parts() if part.part == "identification")
    assert inertia["value"] == part.figures[0].value
    assert inertia["u"] == part.figures[0].u


def test_without_the_plotting_script_the_report_is_static_and_says_so(
    sample: Results, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page, "UPLOT", ("not-there.js", "uPlot.min.css", "LICENSE"))
    document = _report(sample).document().model_copy(update={"interactive": page.has_uplot()})
    text = page.render(document)
    assert "Static report." in text
    assert "script-src 'none'" in text.replace("&#39;", "'")
    assert text.count("<svg") >= 10
    assert "seamlog-data" not in text


def test_a_section_of_ones_own(sample: Results) -> None:
    report = _report(sample)
    report.add_section("notes", "Notes", [Text(text="Torch nozzle was changed.")])
    document = report.document()
    assert document.sections[-1].title == "Notes"
    assert "Torch nozzle was changed." in page.render(document)


def test_excitation_calibration_and_findings_are_told(tmp_path: Path) -> None:
    results = Results.create(tmp_path / "r")
    excitation = {"verdict": "poor", "reasons": ["one direction only"], "forward_share": 0.98}
    results.write(
        Part(part="identification", title="I", details={"excitation": excitation}),
    )
    calibration = {"kind": "plane", "date": "2025-12-22", "source": "board", "residual_mm": 0.021}
    width = Criterion(
        name="w", label="width", value=8.1, upper=7, verdict="FAIL", place=Place(s_mm=120.0)
    )
    bead = Part(part="bead", title="B", criteria=[width], details={"calibration": calibration})
    results.write(bead)
    results.write(Part(part="tracking", title="T", details={"end_ns": 1_767_225_600_000_000_000}))
    text = page.render(_report(results).document())
    assert "poor; one direction only" in text and "0.98" in text
    assert "plane, board, residual 0.021 mm" in text
    assert "10 days (of 2025-12-22)" in text
    assert "width: 8.1 (limit at most 7) (s = 120.0 mm on the photo)" in text


def test_a_table_over_a_quantity_of_its_own_is_a_curve(tmp_path: Path) -> None:
    results = Results.create(tmp_path / "r")
    table = {"speed_mm_s": np.linspace(-9.0, 9.0, 12), "mean_residual": np.arange(12.0)}
    part = Part(part="identification", title="I")
    results.write(part, tables={"by_speed": (table, {"speed_mm_s": "mm/s", "mean_residual": "N"})})
    blocks = [b for s in _report(results).document().sections for b in s.blocks]
    (plot,) = [block for block in blocks if isinstance(block, Plot)]
    assert (plot.kind, plot.x_label, plot.x_unit) == ("curve_plot", "speed", "mm/s")


def test_one_reason_stands_once_and_the_unknown_before_the_record(tmp_path: Path) -> None:
    results = Results.create(tmp_path / "r")
    width = Criterion(name="w", label="width", value=8.1, upper=7, verdict="FAIL")
    for name in ("bead", "quality", "x_ray"):
        results.write(Part(part=name, title=name, verdict="FAIL", criteria=[width]))
    assert len(_banner(_report(results)).reasons) == 1
    names = [section.name for section in _report(results).document().sections]
    assert names.index("x_ray") < names.index("record") < names.index("provenance")
