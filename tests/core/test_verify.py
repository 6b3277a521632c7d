"""`seamlog verify`: reports, results and inputs that belong together, and such that do not."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from seamlog.called import call_to, calling, filled
from seamlog.cli import run
from seamlog.clock import SIMULATED_EPOCH_NS
from seamlog.mcap.batch import BatchWriter
from seamlog.results import Results


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with session, limits, results and report of half a minute of motion."""
    folder = tmp_path_factory.mktemp("verify")
    t = np.arange(0.0, 30.0, 0.04)
    stamps = SIMULATED_EPOCH_NS + np.rint(1e9 * t).astype(np.int64)
    noise = np.random.default_rng(0).normal(0, 1e-4, t.size)
    x, v, a = 0.05 * np.sin(t), 0.05 * np.cos(t), -0.05 * np.sin(t)
    force = 10 * a + 20 * v + 2 * np.sign(v)
    with BatchWriter(folder / "weld.mcap") as writer:
        measured = {"position_m": x + noise, "velocity_m_s": v}
        writer.write("/table/encoder", {"stamp_ns": stamps} | measured)
        asked = {"position_m": x, "velocity_m_s": v, "acceleration_m_s2": a}
        writer.write("/table/reference", {"stamp_ns": stamps} | asked)
        sent = {"command": force, "saturated": np.zeros(t.size, np.bool_)}
        writer.write("/table/command", {"stamp_ns": stamps} | sent)
    (folder / "limits.toml").write_text("[limits]\ntracking_error_mm = 0.1\n")
    config = ["--config", str(folder / "limits.toml")]
    words = ["analyze", str(folder / "weld.mcap"), "-o", str(folder / "r"), *config]
    assert run(words) in (0, 1)
    (folder / "limits.toml").unlink()
    assert run(["report", str(folder / "r"), "-o", str(folder / "report.html"), "--twin"]) in (0, 1)
    return folder


@pytest.mark.parametrize("report", ["report.html", "report.json"])
def test_a_true_report_is_recomputed_from_its_session(
    made: Path, tmp_path: Path, report: str, capsys: pytest.CaptureFixture[str]
) -> None:
    moved = tmp_path / "another name.mcap"
    shutil.copyfile(made / "weld.mcap", moved)
    assert run(["verify", str(made / report), str(made / "r"), str(moved), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["differences"] == told["untold"] == []
    assert told["recomputed"] > 20 and told["shown"] > 20


def test_without_its_input_nothing_is_claimed(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["verify", str(made / "report.html"), str(made / "r")]) == 6
    assert "not recomputed, input not given: weld.mcap" in capsys.readouterr().out


def test_another_session_is_no_input(made: Path, tmp_path: Path) -> None:
    other = tmp_path / "weld.mcap"
    other.write_bytes((made / "weld.mcap").read_bytes() + b"x")
    assert run(["verify", str(made / "report.html"), str(made / "r"), str(other)]) == 6


def test_a_figure_changed_in_the_report_is_found(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twin = json.loads((made / "report.json").read_text())
    blocks = [b for s in twin["sections"] for b in s["blocks"] if b["kind"] == "figures"]
    blocks[0]["figures"][0]["value"] = 0.0123
    (tmp_path / "report.json").write_text(json.dumps(twin))
    words = ["verify", str(tmp_path / "report.json"), str(made / "r"), str(made / "weld.mcap")]
    assert run(words) == 1
    assert "shown and not in the results" in capsys.readouterr().out


def test_results_changed_after_the_analysis_are_found(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(made / "r", tmp_path / "r")
    results = Results.open(tmp_path / "r")
    part = next(part for part in results.parts() if part.part == "tracking")
    better = part.figures[0].model_copy(update={"value": 0.001})
    changed = part.model_copy(update={"figures": [better, *part.figures[1:]]})
    (tmp_path / "r" / "tracking.json").write_text(changed.model_dump_json())
    words = ["verify", str(made / "report.html"), str(tmp_path / "r"), str(made / "weld.mcap")]
    assert run(words) == 1
    told = capsys.readouterr().out
    assert "tracking: figure rms_error_mm was 0.001, is now" in told
    assert "changed since" in told


@pytest.mark.parametrize(
    "words",
    [
        ["record", "--source", "virtual-cell", "-o", "{output}.mcap"],
        ["analyze", "weld.mcap", "-o", "precious"],
        ["analyze", "weld.mcap", "--output=precious"],
        ["analyze", "weld.mcap", "-oprecious"],
        ["replay", "weld.mcap", "--controller", "own.py:Own", "-o", "{output}.mcap"],
        ["replay", "weld.mcap", "--controller=own.py:Own", "-o", "{output}.mcap"],
    ],
)
def test_a_command_that_may_do_harm_is_not_run(
    made: Path,
    tmp_path: Path,
    words: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Results may come from a stranger: what they say made them is no order."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text("raise SystemExit('ran')")
    shutil.copytree(made / "r", tmp_path / "r")
    for path in (tmp_path / "r").glob("*.json"):
        path.write_text(json.dumps(json.loads(path.read_text()) | {"command": words}))
    run(["report", "r", "-o", "again.html"])
    assert run(["verify", "again.html", "r", str(made / "weld.mcap")]) == 6
    assert "may do harm" in capsys.readouterr().out
    assert not (tmp_path / "precious").exists()


@pytest.mark.parametrize("text", ["", "<html></html>", "{}", "[]", "\x00\xff"])
def test_what_is_no_report_is_said(made: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "x.html").write_text(text)
    assert run(["verify", str(tmp_path / "x.html"), str(made / "r")]) == 3


def test_a_call_holds_no_path_and_can_be_filled_in(tmp_path: Path) -> None:
    session, config = tmp_path / "weld.mcap", tmp_path / "c.toml"
    session.touch()
    config.write_text('[bead]\nmin_width_mm = 5.0\n[replay.controllers.pd]\nname = "a b"\n')
    words = [
        "replay",
        str(session),
        "--results",
        str(tmp_path / "r"),
        "-o",
        str(tmp_path / "n.mcap"),
    ]
    with calling([*words, f"--config={config}", "--force", "--json"]):
        found = call_to(tmp_path / "r")
    settings = ["--set", "bead.min_width_mm=5.0", "--set", 'replay.controllers.pd.name="a b"']
    assert found[:6] == ["replay", "weld.mcap", "--results", "{results}", "-o", "{output}.mcap"]
    assert found[6:] == settings
    assert not any(str(tmp_path) in word for word in found)
    assert filled(found, Path("a"), Path("b"))[3:6] == ["a", "-o", "b.mcap"]
    assert call_to(tmp_path / "r") == []
