"""The source tree and the wheel built from it."""

import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path
from typing import Any

import pytest

ROOMS = ("recorder", "analysis", "reports")


@pytest.fixture(scope="session")
def tree(project: Path) -> Path:
    """The project with its source folders, which the tests of an installed wheel do not have."""
    if not (project / "seamlog").is_dir():
        pytest.skip("needs the source folders: these tests run against a wheel")
    return project


@pytest.fixture(scope="session")
def settings(project: Path) -> dict[str, Any]:
    """pyproject.toml."""
    return tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def wheel(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel built from a copy of the tree."""
    scratch = tmp_path_factory.mktemp("wheel")
    copy = scratch / "tree"
    unwanted = shutil.ignore_patterns("__pycache__", *ROOMS)
    shutil.copytree(tree / "seamlog", copy / "seamlog", ignore=unwanted)
    for name in (*ROOMS, "build_tools"):
        shutil.copytree(tree / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "MANIFEST.in", "README.md", "LICENSE", "THIRD_PARTY.md"):
        shutil.copy2(tree / name, copy / name)
    words = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation"]
    subprocess.run([*words, "-w", str(scratch), str(copy)], check=True, capture_output=True)
    (built,) = scratch.glob("seamlog-*.whl")
    return built


@pytest.fixture(scope="session")
def alone(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bin folder of an environment with the wheel installed and its dependencies borrowed."""
    home = tmp_path_factory.mktemp("alone") / "venv"
    venv.create(home, with_pip=False, symlinks=True)
    (packages,) = home.glob("lib/python*/site-packages")
    borrowed = next(path for path in sys.path if path.endswith("site-packages"))
    (packages / "borrowed.pth").write_text(f"{borrowed}\n", encoding="utf-8")
    words = [sys.executable, "-m", "pip", "--python", str(home / "bin" / "python"), "install"]
    subprocess.run(
        [*words, "--no-deps", "--ignore-installed", str(wheel)], check=True, capture_output=True
    )
    return home / "bin"
