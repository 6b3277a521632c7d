"""Death of the live loop, of the recorder process, and of both."""

import os
import random
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from seamlog import open_session
from seamlog.recorder import Recorder
from seamlog.recorder.folder import root
from tests.recorder.sessions import final_accounts, read_metadata, read_session

LOOP = Path(__file__).with_name("killed_loop.py")
KILLS = 20


def wait_for(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "nothing happened"
        time.sleep(0.01)


def start_loop(session: Path, counters: Path) -> subprocess.Popen[str]:
    counters.write_bytes(bytes(16))
    command = [sys.executable, str(LOOP), str(session), str(counters)]
    loop = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert loop.stdout is not None
    assert loop.stdout.readline() == "ready\n"
    return loop


def kill(loop: subprocess.Popen[str]) -> None:
    loop.kill()
    assert loop.stdout is not None
    loop.stdout.close()
    loop.wait()


@pytest.mark.parametrize("seed", range(KILLS))
def test_a_killed_loop_loses_nothing_that_was_accepted(tmp_path: Path, seed: int) -> None:
    kill_and_check(tmp_path, seed)


def kill_and_check(where: Path, seed: int) -> None:
    session, counters = where / "weld.mcap", where / "counters"
    loop = start_loop(session, counters)
    time.sleep(random.Random(seed).uniform(0.0, 0.9))
    kill(loop)
    wait_for(session.exists)
    accepted = dict(
        zip(
            ("/table/encoder", "/camera/image"),
            struct.unpack("<2Q", counters.read_bytes()),
            strict=True,
        )
    )
    messages, accounts = read_session(session), final_accounts(session)
    for topic, count in accepted.items():
        stamps = [message.publish_time_ns for message in messages.get(topic, [])]
        # One more may have been accepted just before the kill, its count not yet noted.
        assert stamps in (list(range(count)), list(range(count + 1))), topic
        row = accounts[topic]
        assert row.offered == row.accepted + row.dropped + row.refused
        assert row.accepted == row.written + row.lost == len(stamps)
        assert (row.lost, row.dropped) == (0, 0)
    assert [m.values[0] for m in messages.get("/table/encoder", [])] == [
        float(m.publish_time_ns) for m in messages.get("/table/encoder", [])
    ]
    assert read_metadata(session)["seamlog.recording.end"] == {"ending": "the loop died"}
    folder = root() / read_metadata(session)["seamlog.recording"]["id"]
    wait_for(lambda: not folder.exists())


def test_the_loop_goes_on_without_its_recorder_process(tmp_path: Path) -> None:
    session = tmp_path / "weld.mcap"
    recorder = Recorder(session)
    encoder = recorder.channel("/table/encoder")
    assert encoder.put(0, 0.0, 0.0)
    wait_for(lambda: recorder.status().channels[0].written == 1)
    os.kill(recorder.recorder_pid, signal.SIGKILL)
    wait_for(lambda: not recorder.status().is_recording)
    answers = [encoder.put(i, float(i), 0.0) for i in range(1, 50_000)]
    assert recorder.log_frame("/camera/image", np.zeros((480, 640), np.uint8))
    assert answers[0]
    assert not answers[-1]
    status = recorder.close()
    assert any("was lost" in finding and ".part" in finding for finding in status.findings)
    account = status.channels[0]
    assert account.offered == 50_000 == account.accepted + account.dropped
    assert not session.exists()

    partial = tmp_path / "weld.mcap.part"
    with open_session(partial) as unfinished:
        assert unfinished.columns("/table/encoder")["stamp_ns"].tolist() == [0]
        assert unfinished.metadata["seamlog.recording"]["id"] == recorder.id
    folder = root() / recorder.id
    assert sorted(path.suffix for path in folder.glob("*.ring")) == [".ring", ".ring"]
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


def test_a_simulated_loop_does_not_wait_for_a_dead_recorder(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "weld.mcap", pace="simulated")
    encoder = recorder.channel("/table/encoder")
    os.kill(recorder.recorder_pid, signal.SIGKILL)
    assert not all(encoder.put(i, 0.0, 0.0) for i in range(50_000))
    status = recorder.close()
    assert status.channels[0].dropped > 0
    folder = root() / recorder.id
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()
