"""The build step that brings the plotting script, and the generated pages."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import third_party
import uplot


@pytest.fixture
def bare(project: Path, tmp_path: Path) -> Path:
    """The build tools in a tree of their own, where nothing has been fetched."""
    shutil.copytree(
        project / "build_tools",
        tmp_path / "build_tools",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    return tmp_path


def fetch_in(bare: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the step with a Python that has no Node.js, and with no PATH that would."""
    python = Path(sys.base_prefix) / "bin" / f"python{sys.version_info.major}"
    return subprocess.run(
        [
            python,
            "-I",
            "-c",
            "import sys; sys.path[:0] = ['build_tools']; import uplot; uplot.ensure()",
        ],
        cwd=bare,
        env={"PATH": str(bare), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_without_npm_it_warns_and_goes_on(bare: Path) -> None:
    done = fetch_in(bare)
    assert done.returncode == 0
    assert "static plots only" in done.stderr
    assert not (bare / "reports").exists()


def test_a_release_without_the_script_fails(bare: Path) -> None:
    done = fetch_in(bare, SEAMLOG_RELEASE="1")
    assert done.returncode != 0
    assert "npm is missing" in done.stderr


def test_without_network_it_warns_and_goes_on(bare: Path) -> None:
    nowhere = {
        "npm_config_registry": "http://127.0.0.1:9",
        "npm_config_fetch_retry_mintimeout": "1",
    }
    done = subprocess.run(
        [sys.executable, "build_tools/uplot.py"],
        cwd=bare,
        env={**os.environ, **nowhere},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0
    assert "npm pack" in done.stderr
    assert not (bare / "reports").exists()


def test_another_package_is_refused(tmp_path: Path) -> None:
    with pytest.raises(uplot.IntegrityError, match="expected sha512-"):
        uplot.unpack(b"not the package that is pinned", tmp_path / "uplot")
    assert not (tmp_path / "uplot").exists()


def test_a_changed_file_counts_as_missing(tmp_path: Path) -> None:
    if not uplot.is_present():
        pytest.skip("uPlot could not be fetched when this tree was installed")
    shutil.copytree(uplot.FOLDER, tmp_path / "uplot")
    assert uplot.is_present(tmp_path / "uplot")
    with (tmp_path / "uplot" / "uPlot.iife.min.js").open("a") as script:
        script.write(";alert(1)")
    assert not uplot.is_present(tmp_path / "uplot")


def test_no_runtime_dependency_is_under_the_gpl() -> None:
    names = third_party.runtime_names()
    assert {"click", "numpy", "mcap"} <= set(names)
    licences = {
        name: third_party.licence_of(importlib.metadata.distribution(name)) for name in names
    }
    assert {name: text for name, text in licences.items() if "GPL" in text} == {}


@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="versions are those of Python 3.11")
def test_the_licence_table_is_up_to_date(project: Path) -> None:
    assert third_party.page() == (project / "THIRD_PARTY.md").read_text(encoding="utf-8")


def test_generated_pages_are_up_to_date(project: Path) -> None:
    words = [sys.executable, "build_tools/docs.py", "--check"]
    done = subprocess.run(words, cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}: run `make docs`"
