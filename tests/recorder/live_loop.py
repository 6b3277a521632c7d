"""A live loop to be killed: `python live_loop.py SESSION COUNTERS RATE_HZ`, and its test's side.

Encoder and command at RATE_HZ, a picture each 33 of them, one attachment. The stamp is the
monotonic time, the first value the number of the step. After each accepted message its count stands
in the memory-mapped COUNTERS (uint64: encoder, command, pictures), which outlives the process.
"""

import mmap
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from seamlog.recorder import Recorder
from seamlog.recorder.folder import is_locked, root

TOPICS = ("/table/encoder", "/table/command", "/camera/image")


def wait_for(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    """Until `condition` holds."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "nothing happened"
        time.sleep(0.01)


class LiveLoop:
    """The process of such a loop, logging into `weld.mcap` of `folder`."""

    def __init__(self, folder: Path, rate_hz: float = 1000.0) -> None:
        self.session = folder / "weld.mcap"
        self.partial = folder / "weld.mcap.part"
        self._counters = folder / "counters"
        self._counters.write_bytes(bytes(24))
        command = [sys.executable, __file__, str(self.session), str(self._counters), str(rate_hz)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            identity, pid = lines.readline().split()
        self.rings, self.recorder_pid = root() / identity, int(pid)

    @property
    def accepted(self) -> dict[str, int]:
        """Messages by topic; one more may have been accepted just before the loop was killed."""
        counts = struct.unpack("<3Q", self._counters.read_bytes())
        return dict(zip(TOPICS, counts, strict=True))

    def await_end(self) -> None:
        """Until loop and recorder are gone; after a kill that is when their last lock is."""
        self.process.wait()
        wait_for(lambda: not self.rings.exists() or not is_locked(self.rings))


def main(session: str, counters: str, rate_hz: str) -> None:
    """Log until killed."""
    with Path(counters).open("r+b") as file:
        words = memoryview(mmap.mmap(file.fileno(), 24)).cast("Q")
    recorder = Recorder(session, meta={"test": "killed"})
    encoder, command, _ = (recorder.channel(topic).put for topic in TOPICS)
    recorder.attach("wps/a.txt", b"procedure", "text/plain")
    rows, columns = np.mgrid[0:480, 0:640]
    image = ((rows + columns) // 5).astype(np.uint8)
    print(recorder.id, recorder.recorder_pid, flush=True)
    period, start, step = 1 / float(rate_hz), time.monotonic(), 0
    while True:
        time.sleep(max(0.0, start + step * period - time.monotonic()))
        stamp = time.monotonic_ns()
        if encoder(stamp, step, 0.0):
            words[0] += 1
        if command(stamp, step, False):
            words[1] += 1
        if step % 33 == 0 and recorder.log_frame("/camera/image", image, stamp):
            words[2] += 1
        step += 1


if __name__ == "__main__":
    main(*sys.argv[1:])
