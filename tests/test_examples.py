"""The examples run as they stand."""

import subprocess
import sys
import tomllib
from pathlib import Path

from seamlog import open_session
from seamlog.results import Results


def test_record_your_loop(project: Path, tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    words = [sys.executable, str(project / "examples" / "record_your_loop.py"), str(path)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    with open_session(path) as session:
        assert session.info.problems == []
        counts = {topic: channel.count for topic, channel in session.info.channels.items()}
        assert counts["/table/encoder"] == counts["/table/command"] == 100
        assert session.frames("/camera/image")[1].image().shape[:2] == (480, 640)
        assert len(session.info.welds) == 1


def test_example_maps_are_toml(project: Path) -> None:
    files = sorted((project / "examples").glob("*.toml"))
    assert files
    assert all(tomllib.loads(file.read_text()) for file in files)


def test_the_papers_figures(project: Path, tmp_path: Path) -> None:
    words = [sys.executable, str(project / "examples" / "paper.py"), str(tmp_path), "--quick"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "paper.html").stat().st_size > 100_000
    parts = {part.part: part for part in Results.open(tmp_path / "paper.results").parts()}
    assert {f"figure_{number:02}" for number in (3, 4, 5, 6, 8, 9)} == set(parts)

    def value(part: str, name: str) -> float:
        figure = parts[part].figure(name)
        assert figure is not None
        assert isinstance(figure.value, float)
        return figure.value

    assert value("figure_05", "beyond") <= 0
    for name in ("inertia", "viscous_friction", "coulomb_friction"):
        assert abs(value("figure_06", f"{name}_right") - 1) < 0.01
        assert abs(value("figure_08", f"{name}_gated") - 1) < 0.01
    printed = 1 + (1 - 0.75) * 1.0 / 2.14
    assert abs(value("figure_06", "viscous_friction_as_printed") - printed) < 0.01
    assert value("figure_08", "inertia_right") > 1.1
    assert value("figure_09", "right_peak_mm") < 1.0
