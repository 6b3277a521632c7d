"""Faults of the disk and the clock in the recorder process: a shim compiled here, and its dials."""

import mmap
import shutil
import subprocess
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_name("shim.c")
WORDS = 16
FOR_EVER = -1


def compile_shim(folder: Path) -> Path:
    """The shared object; skips where there is no C compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler (gcc) to build the fault shim with")
    made = folder / "shim.so"
    command = [compiler, "-O2", "-shared", "-fPIC", "-o", str(made), str(SOURCE), "-ldl"]
    subprocess.run(command, check=True)
    return made


class Faults:
    """Dials of a shim; all are off at first and may be turned while the recorder runs."""

    def __init__(self, path: Path) -> None:
        path.write_bytes(bytes(8 * WORDS))
        with path.open("r+b") as file:
            self._words = memoryview(mmap.mmap(file.fileno(), 8 * WORDS)).cast("q")

    def fail_writes(self, number: int, times: int) -> None:
        """The next `times` writes leave torn bytes behind and fail with errno `number`."""
        self._words[1], self._words[0] = times, number

    def delay_writes(self, seconds: float) -> None:
        """Each write takes so much longer."""
        self._words[2] = round(seconds * 1e6)

    def shorten_writes(self, size: int) -> None:
        """Each write takes at most `size` bytes."""
        self._words[3] = size

    def fail_syncs(self, number: int, times: int) -> None:
        """The next `times` syncs fail with errno `number`."""
        self._words[5], self._words[4] = times, number

    def delay_syncs(self, seconds: float) -> None:
        """Each sync takes so much longer."""
        self._words[6] = round(seconds * 1e6)

    def step_clock(self, seconds: float) -> None:
        """Move the wall clock of the recorder process, against the true one."""
        self._words[7] = round(seconds * 1e9)

    @property
    def writes(self) -> int:
        """Writes to session files so far."""
        return self._words[8]

    @property
    def syncs(self) -> int:
        """Syncs of session files so far."""
        return self._words[9]

    @property
    def is_used_up(self) -> bool:
        """No more writes or syncs are to fail."""
        return not self._words[1] and not self._words[5]
