"""Live loop and recorder killed together: what `recover` brings back of file and rings."""

import os
import random
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import pytest

from seamlog.cli import run
from seamlog.recorder.folder import read_recording, root
from seamlog.recorder.recovery import recover
from tests.recorder.sessions import final_accounts, read_attachments, read_metadata, read_session

LOOP = Path(__file__).with_name("doomed_loop.py")
QUICK, LONG = 4, 200
RATES = (1000, 100, 10, 1)


class Death(NamedTuple):
    """How far the loop had come."""

    partial: Path
    encoder: int
    pictures: int


@contextmanager
def killed(folder: Path, rate_hz: int, seed: int, least_s: float = 0.05) -> Iterator[Death]:
    """Both processes killed at a random time, the recorder and the loop in random order."""
    dice = random.Random(seed)
    session, counters = folder / "weld.mcap", folder / "counters"
    counters.write_bytes(bytes(24))
    command = [sys.executable, str(LOOP), str(session), str(counters), str(rate_hz)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as loop:
        assert loop.stdout is not None
        assert loop.stdout.readline() == "ready\n"
        time.sleep(dice.uniform(least_s, least_s + (0.9 if rate_hz >= 100 else 2.5)))
        pids = [loop.pid, struct.unpack("<3Q", counters.read_bytes())[2]]
        for pid in dice.sample(pids, 2):
            os.kill(pid, signal.SIGKILL)
    wait_for_end(pids[1])
    encoder, pictures, _ = struct.unpack("<3Q", counters.read_bytes())
    partial = folder / "weld.mcap.part"
    if (folder / "weld.mcap").exists():
        # The recorder was killed last and had just finished.
        partial = folder / "weld.mcap"
    yield Death(partial, encoder, pictures)


def wait_for_end(pid: int) -> None:
    """A killed process keeps its locks until its last thread has come back from the disk."""
    for _ in range(3000):
        tasks = Path(f"/proc/{pid}/task")
        if not tasks.exists() or len(list(tasks.iterdir())) <= 1:
            return
        time.sleep(0.01)
    raise AssertionError("the recorder process did not die")


def rings_of(death: Death) -> Path:
    session = death.partial.parent / "weld.mcap"
    for folder in root().iterdir():
        with suppress(OSError):
            if read_recording(folder).path == str(session):
                return folder
    return root() / "none"


def assert_all_there(session: Path, death: Death) -> None:
    messages, accounts = read_session(session), final_accounts(session)
    wanted = {"/table/encoder": death.encoder, "/camera/image": death.pictures}
    for topic, count in wanted.items():
        found = [message.sequence for message in messages.get(topic, [])]
        # One more may have been accepted whose count was not noted any more.
        assert found in (list(range(count)), list(range(count + 1))), topic
        row = accounts[topic]
        assert row.offered == row.accepted + row.dropped + row.refused
        assert row.accepted == row.written == len(found)
        assert (row.lost, row.dropped, row.refused) == (0, 0, 0)
    assert read_attachments(session)["wps/a.txt"] == ("text/plain", b"procedure")


def check_rings(folder: Path, rate_hz: int, seed: int) -> None:
    with killed(folder, rate_hz, seed) as death:
        before = death.partial.read_bytes()
        rings = rings_of(death)
        output = folder / "out.mcap"
        found = recover(death.partial, output)
        assert found.is_complete, found.problems
        assert_all_there(output, death)
        assert death.partial.read_bytes() == before
        assert not rings.exists()


@pytest.mark.parametrize("seed", range(QUICK))
def test_nothing_is_lost_while_the_rings_are_there(tmp_path: Path, seed: int) -> None:
    check_rings(tmp_path, RATES[seed % 2], seed)


def test_the_command_takes_name_and_rings(tmp_path: Path) -> None:
    with killed(tmp_path, 100, 3, least_s=1.5) as death:
        rings = rings_of(death)
        assert run(["recover", str(death.partial), "--json"]) == 0
        assert not rings.exists()
    session = tmp_path / "weld.mcap"
    assert read_metadata(session)["seamlog.recording.end"]["ending"] == "loop and recorder died"
    assert run(["doctor", str(session)]) == 1
    assert run(["recover", str(death.partial)]) == 2
    # With its rings gone, nothing tells any more how much there was.
    assert run(["recover", str(death.partial), "--force"]) == 1


@pytest.mark.soak
def test_both_killed_and_recovered_two_hundred_times(tmp_path: Path) -> None:
    for seed in range(LONG):
        folder = tmp_path / str(seed)
        folder.mkdir()
        check_rings(folder, RATES[seed % 2] if seed % 10 else RATES[2 + seed // 10 % 2], seed)
        shutil.rmtree(folder)
    print(f"\nboth killed {LONG} times: 0 messages lost after recover, rings removed")
