"""Write errors, short and slow writes, failing and slow syncs: the loop goes on, all is kept."""

import errno
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from seamlog.recorder import Recorder, Status
from seamlog.recorder.folder import root
from tests.faults.accounts import check_identities, ring_stamps, session_stamps, unfinished_stamps
from tests.faults.shim import FOR_EVER, Faults
from tests.recorder.sessions import read_session

PICTURE = np.tile(np.arange(640, dtype=np.uint16).astype(np.uint8), (480, 1))


class Loop:
    """A live loop at about 1 kHz with a picture each 20 ms; remembers what was accepted."""

    def __init__(self, path: Path, **values: object) -> None:
        self.path = path
        self.recorder = Recorder(path, **values)  # type: ignore[arg-type]
        self._put = self.recorder.channel("/table/encoder").put
        self._events = self.recorder.channel("/events").put
        self.recorder.channel("/camera/image")
        self._number = 0
        self.encoder: list[int] = []
        self.pictures: list[int] = []

    def run(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.step()
            time.sleep(0.001)

    def run_until(self, condition: Callable[[], bool], seconds: float = 30.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, self.recorder.status()
            self.step()
            time.sleep(0.001)

    def step(self) -> None:
        self._number += 1
        if self._put(self._number, self._number * 0.5, 0.0):
            self.encoder.append(self._number)
        if self._number % 20 == 0 and self.recorder.log_frame(
            "/camera/image", PICTURE, self._number
        ):
            self.pictures.append(self._number)

    def note(self, text: str) -> None:
        assert self._events(self._number, 7, text)

    def close(self) -> Status:
        status = self.recorder.close()
        check_identities(status)
        return status

    def check_whole(self) -> None:
        """Every accepted message is in the session once, in order."""
        found = session_stamps(self.path)
        assert found["/table/encoder"] == self.encoder
        assert found["/camera/image"] == self.pictures


@pytest.fixture
def loop(tmp_path: Path, faults: Faults) -> Loop:
    made = Loop(tmp_path / "weld.mcap")
    made.run_until(lambda: made.recorder.status().channels[0].written > 0)
    return made


@pytest.mark.parametrize("times", [1, 2, 5])
def test_a_write_error_that_passes(loop: Loop, faults: Faults, times: int) -> None:
    faults.shorten_writes(1000)
    faults.fail_writes(errno.EIO, times)
    loop.run_until(lambda: faults.is_used_up)
    faults.shorten_writes(0)
    loop.run(0.3)
    status = loop.close()
    assert sum(row.lost + row.dropped for row in status.channels) == 0
    assert any("goes on in a new file" in finding for finding in status.findings)
    assert len(status.files) >= 2
    loop.check_whole()
    events = [m.data for file in status.files for m in read_session(Path(file)).get("/events", [])]
    assert any(b"writing failed at byte" in data for data in events)


def test_a_disk_that_is_gone_for_good(loop: Loop, faults: Faults) -> None:
    loop.run(0.3)
    faults.fail_writes(errno.EIO, FOR_EVER)
    loop.run_until(lambda: bool(loop.recorder.status().findings))
    loop.run(0.3)
    status = loop.close()
    row = status.channels[0]
    assert row.accepted == len(loop.encoder)
    assert any(str(root()) in finding for finding in status.findings)
    stamps = unfinished_stamps(loop.path.with_name("weld.mcap.part"), "/table/encoder")
    assert stamps == loop.encoder[: row.written]
    folder = root() / status.recording_id
    for ring in folder.glob("*.json"):
        if "/camera" in ring.read_text() or "/events" in ring.read_text():
            ring.unlink()
    waiting = ring_stamps(folder)["/table/encoder"]
    assert stamps + waiting == loop.encoder


@pytest.mark.parametrize("size", [1, 7, 4096])
def test_short_writes(loop: Loop, faults: Faults, size: int) -> None:
    faults.shorten_writes(size)
    loop.run_until(lambda: faults.writes > 20)
    faults.shorten_writes(0)
    assert loop.close().is_complete
    loop.check_whole()


def test_slow_writes(loop: Loop, faults: Faults) -> None:
    faults.delay_writes(0.02)
    loop.run(0.5)
    faults.delay_writes(0.0)
    assert loop.close().is_complete
    loop.check_whole()


def test_writes_and_syncs_that_stall_for_seconds(loop: Loop, faults: Faults) -> None:
    faults.delay_writes(1.5)
    faults.delay_syncs(1.5)
    loop.run(0.5)
    faults.delay_writes(0.0)
    faults.delay_syncs(0.0)
    loop.run(0.5)
    assert loop.close().is_complete
    loop.check_whole()


def test_a_failed_sync_is_not_tried_again(loop: Loop, faults: Faults) -> None:
    loop.run_until(lambda: loop.recorder.status().channels[0].durable > 0)
    faults.fail_syncs(errno.EIO, 1)
    loop.run_until(lambda: faults.is_used_up)
    durable = loop.recorder.status().channels[0].durable
    loop.run_until(lambda: len(list(loop.path.parent.glob("*.part"))) == 1)
    loop.run_until(lambda: (loop.path.parent / "weld.0002.mcap.part").exists())
    syncs = faults.syncs
    loop.run_until(lambda: faults.syncs > syncs + 1)
    status = loop.close()
    assert any("nothing is durable from here on" in finding for finding in status.findings)
    assert status.channels[0].durable == durable < status.channels[0].written
    assert len(status.files) == 2
    loop.check_whole()


def test_a_full_quota_is_a_full_disk(loop: Loop, faults: Faults) -> None:
    faults.fail_writes(errno.EDQUOT, 1)
    loop.run_until(lambda: faults.is_used_up)
    loop.run(0.3)
    status = loop.close()
    assert any("disk is full" in finding for finding in status.findings)
    loop.check_whole()


@pytest.mark.parametrize("seconds", [3600.0, -3600.0, 0.5])
def test_steps_of_the_wall_clock(loop: Loop, faults: Faults, seconds: float) -> None:
    faults.step_clock(seconds)
    loop.run(0.2)
    faults.step_clock(0.0)
    loop.run(0.2)
    assert loop.close().is_complete
    loop.check_whole()
    messages = read_session(loop.path)
    details = b"".join(m.data for m in messages["/events"])
    assert f"moved by {seconds:+.3f}".encode()[:-2] in details
    assert f"moved by {-seconds:+.3f}".encode()[:-2] in details
    times = [m.log_time_ns for m in messages["/table/encoder"]]
    assert times == sorted(times)
    assert times[-1] - times[0] < 60e9


def test_a_stopped_recorder_process(loop: Loop) -> None:
    os.kill(loop.recorder.recorder_pid, 19)
    loop.run(0.4)
    os.kill(loop.recorder.recorder_pid, 18)
    assert loop.close().is_complete
    loop.check_whole()
