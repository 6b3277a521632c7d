"""Death of the live loop, of the recorder process, and of both."""

import os
import random
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from seamlog import open_session
from seamlog.recorder import Recorder
from seamlog.recorder.folder import root
from tests.faults.accounts import ring_stamps, unfinished_stamps
from tests.recorder.live_loop import LiveLoop, wait_for
from tests.recorder.sessions import assert_all_there, read_metadata

KILLS = 20


@pytest.mark.parametrize("seed", range(KILLS))
def test_a_killed_loop_loses_nothing_that_was_accepted(tmp_path: Path, seed: int) -> None:
    kill_and_check(tmp_path, seed)


def kill_and_check(folder: Path, seed: int) -> None:
    loop = LiveLoop(folder)
    time.sleep(random.Random(seed).uniform(0.0, 0.9))
    loop.process.kill()
    loop.await_end()
    assert_all_there(loop.session, loop.accepted)
    assert read_metadata(loop.session)["seamlog.recording.end"] == {"ending": "the loop died"}
    wait_for(lambda: not loop.rings.exists())


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
    shutil.rmtree(folder)


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
    shutil.rmtree(root() / recorder.id)
    assert sorted({*in_file, *in_rings}) == accepted == list(range(600))


def test_a_simulated_loop_does_not_wait_for_a_dead_recorder(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "weld.mcap", pace="simulated")
    encoder = recorder.channel("/table/encoder")
    os.kill(recorder.recorder_pid, signal.SIGKILL)
    assert not all(encoder.put(i, 0.0, 0.0) for i in range(50_000))
    status = recorder.close()
    assert status.channels[0].dropped > 0
    folder = root() / recorder.id
    shutil.rmtree(folder)
