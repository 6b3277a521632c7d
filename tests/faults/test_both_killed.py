"""Live loop and recorder killed together: what file and rings hold, what `recover` makes of it."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from seamlog.cli import run
from seamlog.recorder.recovery import recover
from tests.faults.accounts import ring_stamps, unfinished_stamps
from tests.faults.telling import Tell
from tests.recorder.live_loop import TOPICS, LiveLoop
from tests.recorder.sessions import assert_all_there, final_accounts, read_metadata

RATES_HZ = (1.0, 30.0, 1000.0)
LONG = 67
"""Kills at each rate."""


class Killed:
    """A loop whose two processes were killed at a random time, in random order."""

    def __init__(self, folder: Path, rate_hz: float, seed: int, least_s: float = 0.05) -> None:
        dice = random.Random(seed)
        self.loop = LiveLoop(folder, rate_hz)
        time.sleep(least_s + dice.uniform(0.0, 0.9 + 2.0 / rate_hz))
        for pid in dice.sample([self.loop.process.pid, self.loop.recorder_pid], 2):
            os.kill(pid, signal.SIGKILL)
        self._killed_ns = time.monotonic_ns()
        self.loop.await_end()
        self.file = self.loop.partial if self.loop.partial.exists() else self.loop.session
        """Finished already if the recorder was killed last."""

    def only_in_rings(self, topic: str) -> list[int]:
        """Stamps of what the file does not hold; checks that nothing is twice or out of order."""
        in_file = unfinished_stamps(self.file, topic)
        in_rings = ring_stamps(self.loop.rings).get(topic, [])
        newer = [stamp for stamp in in_rings if stamp not in set(in_file)]
        assert in_file + newer == sorted({*in_file, *in_rings})
        assert len(in_file + newer) - self.loop.accepted[topic] in (0, 1)
        return newer

    def lost_without_rings_ms(self) -> float:
        """Age of the oldest message that is in the rings only."""
        oldest = [min(self.only_in_rings(topic), default=self._killed_ns) for topic in TOPICS[:2]]
        return (self._killed_ns - min(oldest)) / 1e6

    def recover(self) -> None:
        """Join file and rings; all that was accepted is there, the input as it was."""
        before, output = self.file.read_bytes(), self.file.with_name("out.mcap")
        found = recover(self.file, output)
        assert found.is_complete, found.problems
        assert_all_there(output, self.loop.accepted)
        assert self.file.read_bytes() == before
        assert not self.loop.rings.exists()


@contextmanager
def folder_for(tmp_path: Path, seed: int) -> Iterator[Path]:
    """A folder of its own, gone afterwards."""
    folder = tmp_path / str(seed)
    folder.mkdir()
    yield folder
    shutil.rmtree(folder)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_is_lost_while_the_rings_are_there(
    tmp_path: Path, rate_hz: float, seed: int
) -> None:
    killed = Killed(tmp_path, rate_hz, seed)
    assert killed.lost_without_rings_ms() >= 0.0
    killed.recover()


def test_the_command_takes_name_and_rings(tmp_path: Path) -> None:
    loop = Killed(tmp_path, 100, 3, least_s=1.5).loop
    assert run(["recover", str(loop.partial), "--json"]) == 0
    assert not loop.rings.exists()
    ending = read_metadata(loop.session)["seamlog.recording.end"]["ending"]
    assert ending == "loop and recorder died"
    assert run(["doctor", str(loop.session)]) == 1
    assert run(["recover", str(loop.partial)]) == 2
    # With its rings gone, nothing tells any more how much there was.
    assert run(["recover", str(loop.partial), "--force"]) == 1


def test_a_message_published_but_not_counted_yet_is_accounted_for(tmp_path: Path) -> None:
    script = """
import os, sys
from seamlog.recorder import Recorder
from seamlog.recorder.ring import ACCEPTED
recorder = Recorder(sys.argv[1])
events = recorder.channel("/events")
for number in range(3):
    assert events.put(number, 7, "x")
events.gate.ring.words[ACCEPTED] = 2
os.kill(recorder.recorder_pid, 9)
os.kill(os.getpid(), 9)
"""
    session = tmp_path / "weld.mcap"
    subprocess.run([sys.executable, "-c", script, str(session)], check=False, timeout=60)
    assert recover(session).is_complete
    row = final_accounts(session)["/events"]
    assert (row.accepted, row.written, row.lost) == (3, 3, 0)


@pytest.mark.soak
@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_200_kills_of_both(tmp_path: Path, rate_hz: float, tell: Tell) -> None:
    ages_ms = []
    for seed in range(LONG):
        with folder_for(tmp_path, seed) as folder:
            killed = Killed(folder, rate_hz, seed)
            ages_ms.append(killed.lost_without_rings_ms())
            killed.recover()
    ordered = sorted(ages_ms)
    fault = f"loop and recorder killed at {rate_hz:g} Hz, {LONG} times"
    tell(fault, "accepted messages lost after recover", 0, "", "<= 0")
    tell(fault, "lost without the rings, median", ordered[LONG // 2], "ms", "<= 60")
    tell(fault, "lost without the rings, most", ordered[-1], "ms", "<= 120")
