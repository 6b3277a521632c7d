"""The long forms of kill, stall and full disk, with their figures."""

import errno
import time
from pathlib import Path

import numpy as np
import pytest

from seamlog import open_session
from seamlog.recorder import Recorder
from tests.faults.accounts import check_identities, session_stamps
from tests.faults.shim import Faults
from tests.faults.telling import Tell
from tests.faults.test_disk_errors import Loop
from tests.faults.test_disk_full import MIB, fill, put_until_full
from tests.recorder.live_loop import wait_for
from tests.recorder.test_kill import kill_and_check

pytestmark = pytest.mark.soak


def test_200_kills_of_the_loop(tmp_path: Path, tell: Tell) -> None:
    for seed in range(200):
        folder = tmp_path / str(seed)
        folder.mkdir()
        kill_and_check(folder, seed)
    tell("loop killed, 200 times", "nothing lost, file finished", 200, "", ">= 200")


def test_stalls_of_the_disk(tmp_path: Path, faults: Faults, tell: Tell) -> None:
    image = np.zeros((480, 640, 3), np.uint8)
    ticks: dict[float, list[float]] = {}
    for stall_s in (0.0, 2.0):
        recorder = Recorder(tmp_path / f"weld{stall_s}.mcap")
        put = recorder.channel("/table/encoder").put
        recorder.channel("/camera/image")
        faults.delay_writes(stall_s)
        faults.delay_syncs(stall_s)
        start, found = time.monotonic(), ticks.setdefault(stall_s, [])
        for tick in range(20_000):
            time.sleep(max(0.0, start + tick * 0.001 - time.monotonic()))
            before = time.perf_counter()
            put(tick, 0.0, 0.0)
            if tick % 33 == 0:
                recorder.log_frame("/camera/image", image, tick)
            found.append(time.perf_counter() - before)
        faults.delay_writes(0.0)
        faults.delay_syncs(0.0)
        status = recorder.close()
        check_identities(status)
        assert status.channels[0].dropped == 0
    extra_ms = {
        place: (np.percentile(ticks[2.0], place) - np.percentile(ticks[0.0], place)) * 1e3
        for place in (99.9, 100.0)
    }
    fault = "disk stalls of 2 s at each write and sync, 20 s"
    tell(fault, "extra time of a tick, p99.9", extra_ms[99.9], "ms", "<= 0.5")
    tell(fault, "extra time of a tick, most", extra_ms[100.0], "ms", "<= 5")


def test_full_disks(small_disk: Path, tell: Tell) -> None:
    lost, latest_s = 0, 0.0
    for number in range(10):
        session = small_disk / f"weld{number}.mcap"
        ballast = fill(small_disk, 3 * MIB)
        accepted: list[int] = []
        recorder = Recorder(session)
        seen_ns = put_until_full(recorder, accepted)
        flushed = recorder.status().channels[0].written
        # The first message that found no room; its chunk was the first to fail.
        latest_s = max(latest_s, (seen_ns - accepted[flushed]) / 1e9)
        wait_for(session.exists)
        with open_session(session) as whole:
            assert whole.problems == []
        ballast.unlink()
        status = recorder.close()
        check_identities(status)
        found = session_stamps(session)["/table/encoder"]
        lost += len(set(accepted) - set(found))
        for file in status.files:
            Path(file).unlink()
    fault = "full disk, 10 times, space freed later"
    tell(fault, "accepted messages lost", lost, "", "<= 0")
    tell(fault, "the loop knows after", latest_s, "s", "<= 1")
    tell(fault, "files finished while the disk was full", 10, "", ">= 10")


def test_100_write_errors(tmp_path: Path, faults: Faults, tell: Tell) -> None:
    loop = Loop(tmp_path / "weld.mcap")
    loop.run_until(lambda: loop.recorder.status().channels[0].written > 0)
    for _ in range(100):
        faults.shorten_writes(1000)
        faults.fail_writes(errno.EIO, 1)
        loop.run_until(lambda: faults.is_used_up)
        faults.shorten_writes(0)
        loop.run(0.2)
    status = loop.close()
    loop.check_whole()
    fault = "100 write errors in one recording"
    tell(fault, "accepted messages lost", sum(row.lost for row in status.channels), "", "<= 0")
    tell(fault, "dropped", sum(row.dropped for row in status.channels), "", "<= 0")
