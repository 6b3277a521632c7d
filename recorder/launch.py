"""Starting, watching and ending the recorder process."""

import fcntl
import glob
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import seamlog
from seamlog.errors import OutputExists
from seamlog.files import check_output
from seamlog.segments import segment_path

from .folder import Recording
from .segment import claim, sync_folder

_START_S = 10.0
"""The loop waits so long at most until the recorder process works."""
_PATIENCE_S = 30.0
"""`finish` gives up when the recorder process has moved nothing for so long."""


def claim_partial(recording: Recording) -> int:
    """Create and lock the `.part` file of a recording; returns its descriptor.

    `OutputExists` if the session, or an unfinished one of that name, is there already; `force`
    replaces both, but never one that is being recorded.
    """
    check_output(Path(recording.path), recording.force)
    partial = recording.partial
    if partial.exists():
        _refuse_living(partial)
        if not recording.force:
            raise OutputExists(
                f"{partial} is there already, from a recording that was not finished; save it "
                "with 'seamlog recover' and move it away, or give --force to replace it"
            )
        partial.unlink()
    second = segment_path(Path(recording.path), 2)
    if second.exists() and not recording.force:
        raise OutputExists(f"{second}, of an earlier recording, is there; move it or give --force")
    descriptor = claim(partial)
    with suppress(OSError):
        sync_folder(partial.parent)
    return descriptor


def _refuse_living(partial: Path) -> None:
    with partial.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            message = f"{partial} is being recorded by another process"
            raise OutputExists(message) from None


class WritingProcess:
    """The recorder process as the loop sees it.

    It is told of the loop's end by the end of a pipe and by a descriptor of the loop's process,
    which also works when a forked child of the loop keeps the pipe open. What it says meanwhile,
    a JSON object per line, goes to `hear` in a thread that sleeps until there is something.
    """

    def __init__(
        self, folder: Path, partial: int, lock: int, hear: Callable[[dict[str, Any]], None]
    ) -> None:
        self._folder = folder
        self._hear = hear
        self._last: dict[str, Any] | None = None
        self._ready = threading.Event()
        inner, self._pipe = os.pipe()
        own = _own_process()
        passed = [number for number in (partial, lock, inner, own) if number >= 0]
        script = "seamlog.recorder.process"
        command = [sys.executable, "-P", "-m", script, str(folder), str(partial), str(inner)]
        with (folder / "errors.txt").open("wb") as errors:
            self._process = subprocess.Popen(
                [*command, str(own)],
                pass_fds=passed,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
                start_new_session=True,
                env=_environment(),
            )
        for number in passed:
            os.close(number)
        self._listener = threading.Thread(target=self._listen, name="recorder", daemon=True)
        self._listener.start()

    def await_ready(self) -> None:
        """Until the process works, or is lost, or takes too long."""
        self._ready.wait(_START_S)

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                with suppress(ValueError):
                    self._take(json.loads(line))
        self._ready.set()

    def _take(self, said: dict[str, Any]) -> None:
        if "ready" in said:
            self._ready.set()
        elif "channels" in said:
            self._last = said
        else:
            self._hear(said)

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def is_alive(self) -> bool:
        """True while the recorder process runs."""
        return self._process.poll() is None

    def leave(self) -> None:
        """Close the pipe: in a forked child, which has no part in the recording, or at the end."""
        pipe, self._pipe = self._pipe, -1
        if pipe >= 0:
            os.close(pipe)

    def finish(self, path: Path) -> dict[str, Any] | None:
        """Tell the process to end and wait while it moves; its accounts, None if it was lost.

        The growth of the `.part` files of the session `path` shows that it works.
        """
        if self._pipe >= 0:
            with suppress(BrokenPipeError):
                os.write(self._pipe, b"C")
        self.leave()
        if self._has_ended(path):
            self._listener.join(_PATIENCE_S)
        return self._last

    def _has_ended(self, path: Path) -> bool:
        seen, since = -1, time.monotonic()
        while time.monotonic() - since < _PATIENCE_S:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout=0.5)
                return True
            size = _size_of_parts(path)
            if size != seen:
                seen, since = size, time.monotonic()
        return False

    def last_words(self) -> str:
        """What the process wrote to its error stream, the last line of it."""
        with suppress(OSError):
            lines = (self._folder / "errors.txt").read_text(errors="replace").split("\n")
            return next((line for line in reversed(lines) if line.strip()), "")
        return ""


def _size_of_parts(path: Path) -> int:
    size = 0
    for part in path.parent.glob(f"{glob.escape(path.stem)}*.part"):
        with suppress(FileNotFoundError):
            size += part.stat().st_size
    return size


def _own_process() -> int:
    try:
        return os.pidfd_open(os.getpid())
    except OSError:
        return -1


def _environment() -> dict[str, str]:
    """This environment, with the folder of this very package on the module path."""
    home = str(Path(seamlog.__file__).resolve().parent.parent)
    paths = [home, os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
