"""A live loop that is to be killed together with its recorder process.

Run as `python doomed_loop.py SESSION COUNTERS RATE_HZ`. COUNTERS, memory-mapped, holds the number
of accepted encoder messages, of accepted pictures, and the recorder's process id.
"""

import mmap
import sys
import time
from pathlib import Path

import numpy as np

from seamlog.recorder import Recorder


def main(session: str, counters: str, rate_hz: str) -> None:
    """Log until killed; the stamp of each message is the time when it was accepted."""
    with Path(counters).open("r+b") as file:
        words = memoryview(mmap.mmap(file.fileno(), 24)).cast("Q")
    recorder = Recorder(session, meta={"test": "doomed"})
    words[2] = recorder.recorder_pid
    put = recorder.channel("/table/encoder").put
    recorder.channel("/camera/image")
    recorder.attach("wps/a.txt", b"procedure", "text/plain")
    rows, columns = np.mgrid[0:120, 0:160]
    image = ((rows + columns) // 5).astype(np.uint8)
    print("ready", flush=True)
    period, start, step = 1 / float(rate_hz), time.monotonic(), 0
    while True:
        time.sleep(max(0.0, start + step * period - time.monotonic()))
        if put(recorder.clock.now_ns(), float(step), 0.0):
            words[0] = step + 1
        if step % 10 == 0 and recorder.log_frame("/camera/image", image):
            words[1] += 1
        step += 1


if __name__ == "__main__":
    main(*sys.argv[1:])
