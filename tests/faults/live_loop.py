"""A live loop to be killed with its recorder: `python live_loop.py SESSION COUNTERS RATE_HZ`.

Encoder and command at RATE_HZ, pictures at a thirtieth of it. Before and after each call its number
stands in the memory-mapped COUNTERS: accepted encoder and command messages, and the time of the
last one, monotonic, in nanoseconds. Prints the recording's id and the recorder's process id.
"""

import mmap
import sys
import time
from pathlib import Path

import numpy as np

from seamlog.recorder import Recorder


def main(session: str, counters: str, rate_hz: float) -> None:
    """Log until killed."""
    with Path(counters).open("r+b") as file:
        words = memoryview(mmap.mmap(file.fileno(), 24)).cast("Q")
    recorder = Recorder(session)
    encoder = recorder.channel("/table/encoder").put
    command = recorder.channel("/table/command").put
    image = np.tile(np.arange(640, dtype=np.uint16).astype(np.uint8), (480, 1))
    recorder.log_frame("/camera/image", image, 0)
    print(recorder.id, recorder.recorder_pid, flush=True)
    start, step = time.monotonic(), 0
    while True:
        time.sleep(max(0.0, start + step / rate_hz - time.monotonic()))
        words[2] = time.monotonic_ns()
        # The stamp is the monotonic time, so that what is missing can be told in milliseconds.
        if encoder(words[2], step, 0.0):
            words[0] += 1
        if command(words[2], step, False):
            words[1] += 1
        if step % 30 == 29:
            recorder.log_frame("/camera/image", image, words[2])
        step += 1


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]))
