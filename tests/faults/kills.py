"""Killing loop and recorder at one random moment, and what is left of the recording."""

import os
import random
import signal
import struct
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from seamlog.recorder.folder import root
from tests.faults.accounts import ring_stamps, unfinished_stamps
from tests.faults.conftest import is_locked

LOOP = Path(__file__).with_name("live_loop.py")
TOPICS = ("/table/encoder", "/table/command")


@dataclass(frozen=True)
class Remains:
    """What was accepted, and where it is after the kill."""

    accepted: dict[str, int]
    in_file: dict[str, list[int]]
    in_rings: dict[str, list[int]]
    killed_ns: int
    partial: Path
    rings: Path

    def missing(self, topic: str) -> int:
        """Accepted messages that neither file nor rings hold."""
        return self.accepted[topic] - len({*self.in_file[topic], *self.in_rings[topic]})

    @property
    def lost_without_rings_ms(self) -> float:
        """Age of the oldest message that is in the rings only."""
        only = [
            stamp
            for topic in TOPICS
            for stamp in set(self.in_rings[topic]) - set(self.in_file[topic])
        ]
        return (self.killed_ns - min(only)) / 1e6 if only else 0.0


def kill_both(folder: Path, rate_hz: float, seed: int) -> Remains:
    """Start a loop, kill it and its recorder process at a random time."""
    session, counters = folder / f"weld{seed}.mcap", folder / f"counters{seed}"
    counters.write_bytes(bytes(24))
    command = [sys.executable, str(LOOP), str(session), str(counters), str(rate_hz)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as loop:
        assert loop.stdout is not None
        identity, pid = loop.stdout.readline().split()
        time.sleep(random.Random(seed).uniform(0.3, 1.0 + 2.0 / rate_hz))
        os.kill(int(pid), signal.SIGKILL)
        loop.kill()
        killed_ns = time.monotonic_ns()
    rings = root() / identity
    deadline = time.monotonic() + 30
    while is_locked(rings):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    partial = session.with_name(session.name + ".part")
    accepted = dict(zip(TOPICS, struct.unpack_from("<2Q", counters.read_bytes()), strict=True))
    in_file = {topic: unfinished_stamps(partial, topic) for topic in TOPICS}
    return Remains(accepted, in_file, ring_stamps(rings), killed_ns, partial, rings)


def check(remains: Remains) -> None:
    """Nothing that was accepted is missing, nothing stands in the file twice or out of order."""
    for topic in TOPICS:
        # One more may have been accepted just before the kill, its count not yet noted.
        assert remains.missing(topic) in (0, -1), topic
        assert remains.in_file[topic] == sorted(set(remains.in_file[topic]))
        newer = [s for s in remains.in_rings[topic] if s not in set(remains.in_file[topic])]
        assert remains.in_file[topic] + newer == sorted({*remains.in_file[topic], *newer})
