"""The recorder process: `python -m seamlog.recorder.process FOLDER FILE PIPE LOOP`.

The three numbers are descriptors: the `.part` file, a pipe that ends with the loop, and the
loop's process (-1 where the system has none). At its end it prints the final accounts as JSON.
"""

import json
import os
import select
import signal
import sys
from contextlib import suppress
from pathlib import Path

from .engine import Engine
from .folder import read_recording

_PASS_MS = 10
"""Pause between two looks at the rings."""


def main(arguments: list[str]) -> None:
    """Record until the loop closes the recording or dies."""
    for ignored in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ignored, signal.SIG_IGN)
    folder = Path(arguments[0])
    partial, pipe, loop = (int(text) for text in arguments[1:])
    engine = Engine(read_recording(folder), folder, partial)
    ending = _record(engine, pipe, loop)
    document = engine.finish(ending)
    with suppress(OSError):
        sys.stdout.write(json.dumps(document))
        sys.stdout.flush()


def _record(engine: Engine, pipe: int, loop: int) -> str:
    watch = select.poll()
    for descriptor in (pipe, loop):
        if descriptor >= 0:
            watch.register(descriptor, select.POLLIN)
    pause = 0
    while not watch.poll(pause):
        pause = 0 if engine.step() else _PASS_MS
    os.set_blocking(pipe, False)
    with suppress(BlockingIOError):
        return "closed" if os.read(pipe, 1) else "the loop died"
    return "the loop died"


if __name__ == "__main__":
    main(sys.argv[1:])
