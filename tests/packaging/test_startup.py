"""Start-up stays cheap: what a command line loads before it does anything is listed here."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from seamlog.cli import COMMANDS

SHOW = "import sys, json; print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
RUN = "import sys; from seamlog.cli import run; code = run(sys.argv[1:]); "
ALLOWED_OUTSIDE = {"click", "seamlog"}
ALLOWED_INSIDE = {
    "seamlog",
    "seamlog.called",
    "seamlog.cli",
    "seamlog.command",
    "seamlog.errors",
    "seamlog.outcome",
}
SLOW_OF_PYTHON = {"asyncio", "importlib.metadata", "multiprocessing", "unittest", "urllib.request"}
HEAVY = {"cv2", "matplotlib", "numba", "pandas", "pyarrow", "scipy"}


def loaded(*arguments: str, folder: Path) -> set[str]:
    """Modules in memory after `seamlog *arguments`, without those of bare Python."""

    def modules(code: str) -> set[str]:
        words = [sys.executable, "-c", code, *arguments]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True)
        return set(json.loads(done.stderr.splitlines()[-1]))

    return modules(RUN + SHOW + "; sys.exit(code)") - modules(SHOW)


def test_help_loads_click_and_nothing_else(tmp_path: Path) -> None:
    names = loaded("--help", folder=tmp_path)
    outside = {name.partition(".")[0] for name in names} - sys.stdlib_module_names
    assert outside <= ALLOWED_OUTSIDE
    assert {name for name in names if name.partition(".")[0] == "seamlog"} <= ALLOWED_INSIDE
    assert not names & SLOW_OF_PYTHON


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_loads_nothing_heavy(command: str, tmp_path: Path) -> None:
    assert not loaded(command, "--help", folder=tmp_path) & HEAVY


def test_info_help_does_without_numpy(tmp_path: Path) -> None:
    assert "numpy" not in loaded("info", "--help", folder=tmp_path)


def test_importing_the_package_loads_nothing_from_outside(tmp_path: Path) -> None:
    words = [sys.executable, "-c", "import seamlog; " + SHOW]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert not set(json.loads(done.stderr)) & {*HEAVY, "numpy", "click", "mcap"}
