"""`seamlog report` as a person and a script meet it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from seamlog.cli import run
from seamlog.results import Part, Results


def test_writes_the_report_and_says_what_it_says(
    sample: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "report.html"
    code = run(["report", str(sample.folder), "-o", str(output), "--title", "Weld 42", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert code == 1
    assert told["verdict"] == "FAIL"
    assert told["path"] == str(output)
    assert told["bytes"] == output.stat().st_size
    assert told["id"] in output.read_text()
    assert "<h1>Weld 42</h1>" in output.read_text()


def test_a_weld_that_nobody_judged_ends_well(tmp_path: Path) -> None:
    Results.create(tmp_path / "r").write(Part(part="health", title="Health"))
    command = ["report", str(tmp_path / "r"), "-o", str(tmp_path / "r.html")]
    assert run([*command, "--date", "2026-03-04"]) == 0
    assert "2026-03-04" in (tmp_path / "r.html").read_text()


def test_nothing_is_overwritten_without_force(
    sample: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "report.html"
    output.write_text("mine")
    assert run(["report", str(sample.folder), "-o", str(output)]) == 2
    assert "--force" in capsys.readouterr().err
    assert output.read_text() == "mine"
    assert run(["report", str(sample.folder), "-o", str(output), "--force"]) == 1
    assert output.read_text().startswith("<!doctype html>")


@pytest.mark.parametrize("content", [None, "", "{}", "not json", '{"part": 3}'])
def test_no_results_is_one_clear_message(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None
) -> None:
    folder = tmp_path / "results"
    if content is not None:
        folder.mkdir()
        (folder / "health.json").write_text(content)
    assert run(["report", str(folder), "-o", str(tmp_path / "r.html")]) == 3
    message = capsys.readouterr().err
    assert str(folder) in message and message.count("\n") == 1
    assert list(tmp_path.glob("*.html")) == []


def test_a_lost_table_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = Results.create(tmp_path / "r")
    results.write(Part(part="health", title="H"), tables={"t": ({"stamp_ns": np.arange(2)}, {})})
    (tmp_path / "r" / "health.t.parquet").unlink()
    assert run(["report", str(tmp_path / "r"), "-o", str(tmp_path / "r.html")]) == 3
    assert "health.t.parquet" in capsys.readouterr().err


def test_help_loads_nothing_heavy() -> None:
    script = (
        "import sys; from seamlog.cli import run; run(['report', '--help']); "
        "print([m for m in ('numpy', 'jinja2', 'cv2', 'pyarrow', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]"
