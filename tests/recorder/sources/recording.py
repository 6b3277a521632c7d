"""Recording from a source in a process of its own, until told to end."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple


class Ended(NamedTuple):
    """How `seamlog record` ended."""

    code: int
    document: dict[str, Any]
    errors: str


class Recording:
    """A running `seamlog record`."""

    def __init__(self, session: Path, *options: str) -> None:
        self.session = session
        self.partial = session.with_name(session.name + ".part")
        command = [sys.executable, "-m", "seamlog.cli", "record", "-o", str(session), "--json"]
        self._process = subprocess.Popen(
            [*command, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=session.parent,
            env=os.environ | {"PYTHONWARNINGS": "default"},
        )

    def wait_until(self, condition: Callable[[], bool], seconds: float = 40.0) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            assert self._process.poll() is None, self.end()
            assert time.monotonic() < deadline, "nothing happened"
            time.sleep(0.02)

    def wait_for_bytes(self, count: int) -> None:
        """Until the unfinished session has grown to `count` bytes."""
        self.wait_until(lambda: self.partial.exists() and self.partial.stat().st_size >= count)

    def wait_for_text(self, text: str) -> None:
        """Until the unfinished session, one of its small metadata records, holds `text`."""
        data = text.encode()
        self.wait_until(lambda: self.partial.exists() and data in self.partial.read_bytes())

    def interrupt(self) -> Ended:
        self._process.send_signal(signal.SIGINT)
        return self.end()

    def end(self) -> Ended:
        out, errors = self._process.communicate(timeout=60)
        document = json.loads(out) if out.startswith("{") else {}
        return Ended(self._process.returncode, document, errors)

    def kill(self) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.communicate()


@contextmanager
def recording(session: Path, *options: str) -> Iterator[Recording]:
    running = Recording(session, *options)
    try:
        yield running
    finally:
        running.kill()


def until_logged(session: Path, topic: str, count: int) -> Callable[[], bool]:
    """Condition: the unfinished session holds so many messages of `topic` already."""
    from seamlog import open_session
    from seamlog.errors import SeamlogError

    partial = session.with_name(session.name + ".part")

    def is_there() -> bool:
        try:
            with open_session(partial) as opened:
                info = opened.info.channels.get(topic)
                return info is not None and info.count >= count
        except (OSError, SeamlogError):
            return False

    return is_there
