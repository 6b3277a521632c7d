"""A loaded recording: 1 kHz encoder and command, 100 pictures of 640 x 480 a second."""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from seamlog import open_session
from seamlog.recorder import Recorder, Status, Storage
from tests.faults.accounts import check_identities
from tests.faults.telling import Tell

MIB = 1 << 20


def pictures(count: int) -> list[NDArray[np.uint8]]:
    rng = np.random.default_rng(0)
    found: list[NDArray[np.uint8]] = []
    for i in range(count):
        image = rng.normal(90, 12, (480, 640, 3)).clip(0, 255).astype(np.uint8)
        image[:, 300 + i : 306 + i] = 240
        found.append(np.asarray(cv2.GaussianBlur(image, (5, 5), 0), np.uint8))
    return found


class LoadedLoop:
    """The loop, its recorder's memory over time, and how long its ticks took."""

    def __init__(self, path: Path, seconds: float) -> None:
        images = pictures(8)
        recorder = Recorder(path, storage=Storage(segment_bytes=64 * MIB))
        encoder = recorder.channel("/table/encoder").put
        command = recorder.channel("/table/command").put
        recorder.channel("/camera/image")
        self.ticks_s: list[float] = []
        self.memory_kib: list[int] = []
        start = time.monotonic()
        for tick in range(round(seconds * 1000)):
            time.sleep(max(0.0, start + tick * 0.001 - time.monotonic()))
            before = time.perf_counter()
            encoder(tick, tick * 1e-3, 0.0)
            command(tick, 0.5, False)
            if tick % 10 == 0:
                recorder.log_frame("/camera/image", images[tick // 10 % 8], tick)
            self.ticks_s.append(time.perf_counter() - before)
            if tick % 1000 == 999:
                self.memory_kib.append(_private_kib(recorder.recorder_pid))
        self.status: Status = recorder.close()

    def check(self, path: Path) -> None:
        check_identities(self.status)
        with open_session(path) as session:
            counts = {topic: row.count for topic, row in session.info.channels.items()}
        for row in self.status.channels:
            assert (row.written, row.lost) == (counts[row.topic], 0)

    @property
    def dropped(self) -> int:
        return sum(row.dropped + row.refused for row in self.status.channels)


def _private_kib(pid: int) -> int:
    """Memory of the process without the rings, which are shared."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))


def test_some_seconds_under_load(tmp_path: Path) -> None:
    loop = LoadedLoop(tmp_path / "weld.mcap", 4.0)
    loop.check(tmp_path / "weld.mcap")
    assert len(loop.memory_kib) == 4


@pytest.mark.soak
@pytest.mark.timeout(1200)
def test_ten_minutes_under_load(tmp_path: Path, tell: Tell) -> None:
    loop = LoadedLoop(tmp_path / "weld.mcap", 600.0)
    loop.check(tmp_path / "weld.mcap")
    fault = "10 minutes at 1 kHz + 1 kHz + 100 fps of 640 x 480"
    tell(fault, "files", len(loop.status.files))
    tell(fault, "tick p99.9", float(np.percentile(loop.ticks_s, 99.9)) * 1e3, "ms")
    first, last = np.median(loop.memory_kib[60:120]), np.median(loop.memory_kib[-60:])
    tell(fault, "recorder memory", float(last) / 1024, "MiB")
    tell(fault, "its growth after the first minute", float(last - first) / 1024, "MiB", "<= 8")
    tell(fault, "dropped", loop.dropped, "", "<= 0")
