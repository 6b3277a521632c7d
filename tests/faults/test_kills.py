"""Loop and recorder killed at one moment: file and rings together hold all that was accepted."""

import os
import signal
import time
from pathlib import Path

import pytest

from seamlog.recorder import Recorder
from seamlog.recorder.folder import root
from tests.faults.accounts import ring_stamps, unfinished_stamps
from tests.faults.kills import check, kill_both
from tests.faults.telling import Tell

RATES_HZ = (1.0, 30.0, 1000.0)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_both_killed(tmp_path: Path, rate_hz: float) -> None:
    check(kill_both(tmp_path, rate_hz, 1))


def test_only_the_recorder_killed(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "weld.mcap")
    put = recorder.channel("/table/encoder").put
    accepted = []
    for number in range(600):
        if number == 400:
            os.kill(recorder.recorder_pid, signal.SIGKILL)
        if put(number, 0.0, 0.0):
            accepted.append(number)
        time.sleep(0.001)
    recorder.close()
    in_file = unfinished_stamps(tmp_path / "weld.mcap.part", "/table/encoder")
    in_rings = ring_stamps(root() / recorder.id)["/table/encoder"]
    assert sorted({*in_file, *in_rings}) == accepted == list(range(600))


@pytest.mark.soak
@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_200_kills_of_both(tmp_path: Path, rate_hz: float, tell: Tell) -> None:
    ages_ms = []
    for seed in range(200 // len(RATES_HZ) + 1):
        remains = kill_both(tmp_path, rate_hz, seed)
        check(remains)
        ages_ms.append(remains.lost_without_rings_ms)
    name = f"both killed at {rate_hz:g} Hz"
    tell(f"{name}: kills with nothing lost", len(ages_ms), "")
    ordered = sorted(ages_ms)
    tell(f"{name}: lost without the rings, median", ordered[len(ordered) // 2], "ms", "<= 60")
    tell(f"{name}: lost without the rings, most", ordered[-1], "ms", "<= 120")
