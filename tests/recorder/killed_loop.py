"""A live loop to be killed: 1 kHz encoder and 30 fps pictures, what was accepted told apart.

Run as `python killed_loop.py SESSION COUNTERS`. After each accepted message its count stands in
the memory-mapped file COUNTERS (two uint64: encoder, pictures), which outlives the process.
"""

import mmap
import sys
import time
from pathlib import Path

import numpy as np

from seamlog.recorder import Recorder


def main(session: str, counters: str) -> None:
    """Log until killed."""
    with Path(counters).open("r+b") as file:
        words = memoryview(mmap.mmap(file.fileno(), 16)).cast("Q")
    recorder = Recorder(session, meta={"test": "killed"})
    put = recorder.channel("/table/encoder").put
    recorder.channel("/camera/image")
    rows, columns = np.mgrid[0:480, 0:640]
    image = ((rows + columns) // 5).astype(np.uint8)
    print("ready", flush=True)
    start, step, pictures = time.monotonic(), 0, 0
    while True:
        time.sleep(max(0.0, start + step * 0.001 - time.monotonic()))
        if put(step, step, 0.0):
            words[0] = step + 1
        if step * 30 // 1000 >= pictures:
            if recorder.log_frame("/camera/image", image, pictures):
                words[1] = pictures + 1
            pictures += 1
        step += 1


if __name__ == "__main__":
    main(*sys.argv[1:])
