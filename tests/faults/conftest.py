"""Fixtures of the fault programme."""

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from seamlog.recorder import folder as rings
from tests.faults.shim import Faults, compile_shim
from tests.faults.telling import ROWS, Tell, table, tell


@pytest.fixture(scope="session")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled shim."""
    return compile_shim(tmp_path_factory.mktemp("shim"))


@pytest.fixture
def faults(shim: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Faults:
    """Dials for the recorder processes that this test starts."""
    dials = Faults(tmp_path / "faults")
    monkeypatch.setenv("SEAMLOG_FAULTS", str(tmp_path / "faults"))
    monkeypatch.setenv("LD_PRELOAD", str(shim))
    return dials


@pytest.fixture(autouse=True)
def no_rings_left(tmp_path: Path) -> Iterator[None]:
    """Remove the rings that this test left behind on purpose."""
    yield
    for folder in rings.root().iterdir():
        with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
            if rings.read_recording(folder).path.startswith(f"{tmp_path}/"):
                shutil.rmtree(folder, ignore_errors=True)


def mounted(folder: Path, *arguments: str) -> Iterator[Path]:
    """Mount something for one test; skips where that is not allowed."""
    if os.geteuid() != 0:
        pytest.skip("mounting a small file system needs root")
    folder.mkdir()
    done = subprocess.run(["mount", *arguments, str(folder)], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"no file system can be mounted here: {done.stderr.strip()}")
    try:
        yield folder
    finally:
        with contextlib.suppress(subprocess.CalledProcessError):
            subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 12 MiB."""
    yield from mounted(tmp_path / "small", "-t", "tmpfs", "-o", "size=12m", "none")


@pytest.fixture(name="tell")
def _tell() -> Tell:
    """Print a figure at the end of the run."""
    return tell


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The figures of the long runs."""
    if ROWS:
        terminalreporter.section("figures of the fault programme")
        for line in table(ROWS):
            terminalreporter.write_line(line)
