"""What stands beside the page: JSON twin and its schema, tables, PDF; and the size of the page."""

import csv
import json
from pathlib import Path
from typing import Any

import cv2
import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pypdf
import pytest

from seamlog.cli import run
from seamlog.errors import UsageError
from seamlog.reports.content import Frames, Moment
from seamlog.reports.curves import Plot
from seamlog.reports.document import Document
from seamlog.reports.export import export_tables
from seamlog.reports.report import Report
from seamlog.reports.run import Run
from seamlog.reports.size import fitted
from seamlog.results import Figure, Part, Picture, Results
from tests.browsing import Visitor
from tests.reports.sample_results import START_NS


def _document(results: Results) -> Document:
    report = Report()
    report.add_results(results)
    return report.document()


def test_the_twin_fits_its_published_schema(sample: Results, project: Path) -> None:
    schema = json.loads((project / "docs" / "schema" / "report.schema.json").read_text())
    twin = _document(sample).twin()
    jsonschema.validate(twin, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(twin | {"verdict": "GOOD"}, schema)


def test_parts_fit_their_published_schema(sample: Results, project: Path) -> None:
    schema = json.loads((project / "docs" / "schema" / "results-part.schema.json").read_text())
    for path in sample.folder.glob("*.json"):
        jsonschema.validate(json.loads(path.read_text()), schema)


def test_the_command_writes_twin_and_tables_beside_the_page(
    sample: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "report.html"
    words = ["report", str(sample.folder), "-o", str(output), "--twin", "--tables", "csv", "--json"]
    assert run(words) == 1
    told = json.loads(capsys.readouterr().out)
    twin = json.loads(Path(told["twin"]).read_text())
    assert twin["id"] == told["id"]
    assert json.dumps(twin["id"]) in output.read_text()
    with (Path(told["tables"]) / "figures.csv").open(newline="") as file:
        rows = {(row["part"], row["kind"], row["name"]): row for row in csv.DictReader(file)}
    part = next(part for part in sample.parts() if part.part == "identification")
    inertia = rows["identification", "figure", "inertia"]
    assert float(inertia["value"]) == part.figures[0].value
    assert float(inertia["U_k2"]) == pytest.approx(2 * 0.0041)
    assert rows["bead", "limit", "width"]["verdict"] == "FAIL"
    assert rows["identification", "figure", "offset"]["value"] == ""
    assert run(words) == 2  # nothing is replaced without --force


@pytest.mark.parametrize("table_format", ["csv", "parquet"])
def test_tables_come_back_as_they_were(sample: Results, tmp_path: Path, table_format: Any) -> None:
    export_tables([Run(sample, 0)], tmp_path / "tables", table_format)
    part = next(part for part in sample.parts() if part.part == "tracking")
    error = sample.columns(part, "error")["error_mm"]
    path = tmp_path / "tables" / f"tracking-error.{table_format}"
    if table_format == "parquet":
        found = pq.read_table(path)["error_mm"].to_numpy()
    else:
        with path.open(newline="") as file:
            found = np.array([float(row["error_mm [mm]"]) for row in csv.DictReader(file)])
    assert np.array_equal(found, error)


def test_a_text_is_no_formula_in_a_spreadsheet(tmp_path: Path) -> None:
    results = Results.create(tmp_path / "r")
    figure = Figure(name="n", label="=HYPERLINK(1)", value="@SUM(A1)")
    results.write(Part(part="health", title="H", figures=[figure]))
    export_tables([Run(results, 0)], tmp_path / "t", "csv")
    with (tmp_path / "t" / "figures.csv").open(newline="") as file:
        row = next(csv.DictReader(file))
    assert (row["label"], row["value"]) == ("'=HYPERLINK(1)", "'@SUM(A1)")


def test_pdf_holds_verdict_and_drawings(sample: Results, tmp_path: Path, chromium: str) -> None:
    assert chromium
    output = tmp_path / "report.html"
    assert run(["report", str(sample.folder), "-o", str(output), "--pdf"]) == 1
    reader = pypdf.PdfReader(tmp_path / "report.pdf")
    text = "".join(page.extract_text() for page in reader.pages)
    assert len(reader.pages) >= 4
    assert "FAIL" in text and "Bead width along the weld" in text and "WPS-135-07" in text


def test_pdf_without_a_browser_is_a_missing_device(
    sample: Results,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    output = tmp_path / "report.html"
    assert run(["report", str(sample.folder), "-o", str(output), "--pdf"]) == 4
    assert "apt install" in capsys.readouterr().err
    assert not (tmp_path / "report.pdf").exists()


@pytest.fixture(scope="module")
def heavy(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Ten hours at 10 Hz with 150 large camera pictures."""
    results = Results.create(tmp_path_factory.mktemp("heavy") / "r")
    random = np.random.default_rng(0)
    stamps = START_NS + np.arange(360_000) * 100_000_000
    table = {"stamp_ns": stamps, "wave": random.normal(size=stamps.size)}
    small = {"stamp_ns": stamps[::1000], "slow": np.round(random.normal(size=360), 2)}
    noise = random.integers(0, 255, (150, 240, 320), np.uint8)
    pictures = {}
    for number, image in enumerate(noise):
        data = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, 70])[1].tobytes()
        time_ns = START_NS + number * 240_000_000_000
        entry = Picture(
            file="f.webp", caption="Camera", width_px=320, height_px=240, sha256="", time_ns=time_ns
        )
        pictures[f"f{number}"] = (data, entry)
    results.write(
        Part(part="tracking", title="Tracking"),
        tables={"wave": (table, {}), "slow": (small, {})},
        pictures=pictures,
    )
    return results


def _frames(document: Document) -> int:
    blocks = [b for section in document.sections for b in section.blocks]
    return sum(len(block.frames) for block in blocks if isinstance(block, Frames))


def test_pictures_are_thinned_before_anything_else(heavy: Results) -> None:
    whole = _document(heavy)
    _, text = fitted(whole, 10**9)
    size = len(text.encode())
    cut, text = fitted(whole, size - 1_500_000)
    assert len(text.encode()) <= size - 1_500_000
    assert 10 < _frames(cut) < _frames(whole) == 150
    plots = [b for s in cut.sections for b in s.blocks if isinstance(b, Plot)]
    assert all(plot.live for plot in plots)
    assert cut.notes == [
        f"{_frames(cut)} of 150 camera pictures are in this file, to keep it small."
    ]
    assert cut.notes[0] in text


def test_then_the_heaviest_curves_stay_as_drawings(
    heavy: Results, tmp_path: Path, visitor: Visitor
) -> None:
    cut, text = fitted(_document(heavy), 1_000_000)
    assert len(text.encode()) <= 1_000_000
    plots = {b.title: b.live for s in cut.sections for b in s.blocks if isinstance(b, Plot)}
    assert plots == {"Wave": False, "Slow": True}
    assert "drawings without their points" in cut.notes[1] and cut.notes[1] in text
    path = tmp_path / "cut.html"
    path.write_text(text)
    visit = visitor.open(path)
    assert visit.complaints == []
    assert visit.page.locator("html").get_attribute("data-state") == "live"
    assert visit.page.locator("#plot-0-tracking-wave-wave .static").is_visible()
    assert visit.page.locator("#plot-0-tracking-slow-slow .static").is_hidden()


def test_a_cut_report_still_follows_its_camera(sample: Results) -> None:
    cut, _ = fitted(_document(sample), 50_000)
    moments = [b for s in cut.sections for b in s.blocks if isinstance(b, Moment)]
    assert moments[0].frames_id == "frames-0-seam"


def test_the_builder_takes_text_figures_curves_and_pictures(
    tmp_path: Path, visitor: Visitor
) -> None:
    report = Report("Own")
    report.add_text("Notes", "First.", "Second.")
    report.add_figures("Gas", [Figure(name="flow", label="flow", value=12.0, u=0.2, unit="l/min")])
    seconds = np.arange(100) / 10
    report.add_curves("Flow", seconds, {"flow": np.sin(seconds)}, "l/min", limits={"least": -0.5})
    report.add_curves("Flow", seconds, {"flow": np.cos(seconds)})
    report.add_picture("Nozzle", np.full((20, 30), 128, np.uint8))
    report.write(tmp_path / "own.html")
    page = visitor.open(tmp_path / "own.html").page
    text = page.inner_text("main")
    assert all(word in text for word in ("First.", "Second.", "12.00 ± 0.40 l/min", "least"))
    assert page.locator("#flow canvas").count() == page.locator("#flow-2 canvas").count() == 1
    assert page.locator("#nozzle img").evaluate("image => image.naturalWidth") == 30


def test_the_builder_refuses_what_cannot_be_drawn() -> None:
    report = Report("Own")
    with pytest.raises(UsageError, match="one length"):
        report.add_curves("a", [1, 2, 3], {"y": [1, 2]})
    with pytest.raises(UsageError, match="ascend"):
        report.add_curves("a", [2, 1], {"y": [1, 2]})
    with pytest.raises(UsageError, match="uint8"):
        report.add_picture("a", np.zeros((2, 2)))
    report.add_section("mine", "Mine", [])
    with pytest.raises(UsageError, match="already"):
        report.add_section("mine", "Mine", [])
