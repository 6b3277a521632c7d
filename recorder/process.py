"""The recorder process: `python -m seamlog.recorder.process FOLDER FILE PIPE LOOP`.

The three numbers are descriptors: the `.part` file, a pipe that ends with the loop, and the
loop's process (-1 where the system has none). It prints a JSON object per line: `ready`,
`finding`, `warning` and `stop` while it works, the final accounts at its end.
"""

import json
import os
import select
import signal
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from .engine import CLOSED, Engine
from .folder import read_recording
from .pictures import load_encoder

_PASS_MS = 10
"""Pause between two looks at the rings."""
_LONGEST = 500
"""Characters of one text: a line shorter than a page is written whole or not at all."""


def main(arguments: list[str]) -> None:
    """Record until the loop closes the recording or dies."""
    for ignored in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ignored, signal.SIG_IGN)
    _stand_aside()
    folder = Path(arguments[0])
    partial, pipe, loop = (int(text) for text in arguments[1:])
    os.set_blocking(sys.stdout.fileno(), False)
    engine = Engine(read_recording(folder), folder, partial, _say)
    load_encoder()
    _say({"ready": "yes"})
    ending = _record(engine, pipe, loop)
    document = engine.finish(ending)
    os.set_blocking(sys.stdout.fileno(), True)
    with suppress(OSError):
        sys.stdout.write(json.dumps(document) + "\n")
        sys.stdout.flush()


def _stand_aside() -> None:
    """Inherit neither the priority of the loop nor the processors that it claims for itself."""
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, 0, max(0, os.getpriority(os.PRIO_PROCESS, 0)))
    if others := set(range(os.cpu_count() or 1)) - os.sched_getaffinity(0):
        # Where it may not run on those, it stays with the loop.
        with suppress(OSError):
            os.sched_setaffinity(0, others)


def _say(said: Mapping[str, str]) -> None:
    """Tell the loop, which may be gone or may not listen: then it is told at the end."""
    short = {key: text[:_LONGEST] for key, text in said.items()}
    with suppress(OSError):
        os.write(sys.stdout.fileno(), json.dumps(short).encode() + b"\n")


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
        return CLOSED if os.read(pipe, 1) else "the loop died"
    return "the loop died"


if __name__ == "__main__":
    main(sys.argv[1:])
