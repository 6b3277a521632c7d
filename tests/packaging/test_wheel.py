"""The wheel holds what a user needs and works alone."""

import json
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import pytest
import uplot


@pytest.fixture(scope="module")
def members(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_holds_every_module_and_nothing_else(
    tree: Path, members: set[str], settings: dict[str, Any]
) -> None:
    wanted = {"seamlog/py.typed"}
    for name in settings["tool"]["setuptools"]["packages"]:
        folder = Path(*name.split("."))
        files = (tree / folder).glob("*.*")
        wanted |= {str(folder / path.name) for path in files if path.suffix in (".py", ".toml")}
    for kind in ("templates", "assets"):
        found = (tree / "reports" / kind).rglob("*")
        wanted |= {f"seamlog/{path.relative_to(tree)}" for path in found if path.is_file()}
    assert {name for name in members if ".dist-info/" not in name} == wanted


def test_holds_licence_and_notices(members: set[str]) -> None:
    names = {Path(name).name for name in members if ".dist-info/" in name}
    assert {"LICENSE", "THIRD_PARTY.md", "entry_points.txt"} <= names


def test_holds_the_plotting_script(members: set[str]) -> None:
    if not uplot.is_present():
        pytest.skip("uPlot could not be fetched when this tree was installed")
    names = {Path(member).name for member in uplot.FILES}
    assert {f"seamlog/reports/assets/uplot/{name}" for name in names} <= members


def test_answers_from_another_folder(alone: Path, tmp_path: Path) -> None:
    (tmp_path / "analysis.py").write_text("raise RuntimeError('a file of the user')")
    done = subprocess.run(
        [alone / "seamlog", "--help"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert "record" in done.stdout


def test_runs_its_own_files(alone: Path, tmp_path: Path) -> None:
    code = "import json, seamlog, seamlog.recorder as r, seamlog.reports as p; "
    code += "print(json.dumps([seamlog.__file__, r.__file__, p.__file__]))"
    done = subprocess.run(
        [alone / "python", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert all(Path(path).is_relative_to(alone.parent) for path in json.loads(done.stdout))
