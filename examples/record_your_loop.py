"""Record a live loop: one second of a table that follows a sine, at 100 Hz, with two pictures.

Run it with `python examples/record_your_loop.py session.mcap`, then `seamlog info session.mcap`.
"""

import math
import sys
import time

import numpy as np

from seamlog.channels import ARC_OFF, ARC_ON
from seamlog.recorder import Recorder


def main(path: str) -> None:
    """Log position, velocity and command while a loop runs."""
    with Recorder(path, meta={"part": "bracket 7"}) as recorder:
        encoder = recorder.channel("/table/encoder")
        command = recorder.channel("/table/command", {"unit": "V"})
        recorder.log("/events", kind=ARC_ON, detail="arc on")
        start = time.monotonic()
        for step in range(100):
            elapsed_s = step * 0.01
            time.sleep(max(0.0, start + elapsed_s - time.monotonic()))
            position_m, velocity_m_s = 0.1 * math.sin(elapsed_s), 0.1 * math.cos(elapsed_s)
            encoder.put(time.time_ns(), position_m, velocity_m_s)
            command.put(time.time_ns(), 2.0 * velocity_m_s, False)
            if step % 50 == 0:
                recorder.log_frame("/camera/image", np.full((480, 640), 90 + step, np.uint8))
        recorder.log("/events", kind=ARC_OFF, detail="arc off")


if __name__ == "__main__":
    main(sys.argv[1])
