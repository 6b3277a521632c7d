"""Loss of power at a random moment: what was called durable is there."""

import os
import random
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from seamlog.recorder import Recorder, Storage
from seamlog.recorder.storage import SyncPolicy
from tests.faults.accounts import unfinished_stamps
from tests.faults.power import Disk
from tests.faults.telling import Tell

TOPIC = "/table/encoder"
PICTURE = np.tile(np.arange(640, dtype=np.uint16).astype(np.uint8), (480, 1))


@pytest.fixture(params=["ext4", "xfs"])
def disk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Disk]:
    made = Disk(tmp_path, request.param)
    yield made
    made.unmount()


class Loss:
    """What was accepted and durable when the power went, and what is there afterwards."""

    def __init__(self, disk: Disk, name: str, seconds: float, sync: SyncPolicy) -> None:
        path = disk.path / f"{name}.mcap"
        recorder = Recorder(path, storage=Storage(sync=sync))
        accepted, durable = self._log(recorder, disk, seconds)
        os.kill(recorder.recorder_pid, signal.SIGKILL)
        recorder.close()
        disk.power_up()
        found = _stamps(path)
        path.with_name(path.name + ".part").unlink(missing_ok=True)
        assert found == accepted[: len(found)]
        self.durable_lost = max(durable - len(found), 0)
        self.durable = durable
        self.lost_ms = (accepted[-1] - found[-1]) / 1e6 if found else 1e3 * seconds

    def _log(self, recorder: Recorder, disk: Disk, seconds: float) -> tuple[list[int], int]:
        put = recorder.channel(TOPIC).put
        recorder.channel("/camera/image")
        accepted: list[int] = []
        start = time.monotonic()
        while time.monotonic() - start < seconds or not _durable(recorder):
            stamp = time.monotonic_ns()
            assert put(stamp, 1.0, 2.0)
            accepted.append(stamp)
            if len(accepted) % 33 == 0:
                recorder.log_frame("/camera/image", PICTURE, stamp)
            time.sleep(0.001)
        durable = _durable(recorder)
        disk.cut_power()
        return accepted, durable


def _durable(recorder: Recorder) -> int:
    return recorder.status().channels[0].durable


def _stamps(path: Path) -> list[int]:
    partial = path.with_name(path.name + ".part")
    return unfinished_stamps(partial, TOPIC) if partial.exists() else []


@pytest.mark.parametrize("sync", ["default", "strict"])
def test_what_is_durable_survives(disk: Disk, sync: SyncPolicy) -> None:
    for seed in range(2):
        loss = Loss(disk, f"weld{seed}", random.Random(seed).uniform(0.3, 0.9), sync)
        assert loss.durable > 0
        assert loss.durable_lost == 0


def test_a_finished_session_survives_at_once(disk: Disk) -> None:
    with Recorder(disk.path / "weld.mcap") as recorder:
        put = recorder.channel(TOPIC).put
        for number in range(1000):
            put(number, 0.0, 0.0)
    status = recorder.close()
    disk.cut_power()
    disk.power_up()
    assert status.channels[0].durable == 1000
    assert unfinished_stamps(disk.path / "weld.mcap", TOPIC) == list(range(1000))


def test_an_arc_off_is_durable_at_once(disk: Disk) -> None:
    recorder = Recorder(disk.path / "weld.mcap", storage=Storage(sync="eco"))
    put, event = recorder.channel(TOPIC).put, recorder.channel("/events").put
    for number in range(100):
        put(number, 0.0, 0.0)
    event(100, 2, "arc off")
    deadline = time.monotonic() + 4.0
    while _durable(recorder) < 100 and time.monotonic() < deadline:
        time.sleep(0.001)
    disk.cut_power()
    os.kill(recorder.recorder_pid, signal.SIGKILL)
    recorder.close()
    disk.power_up()
    assert _stamps(disk.path / "weld.mcap") == list(range(100))


@pytest.mark.soak
def test_losses_of_power(disk: Disk, tell: Tell) -> None:
    random_s = random.Random(1)
    losses = [Loss(disk, f"weld{n}", random_s.uniform(0.3, 3.0), "default") for n in range(25)]
    fault = f"loss of power, {len(losses)} times on {_kind(disk)}"
    tell(fault, "durable messages lost", sum(row.durable_lost for row in losses), "", "<= 0")
    tell(fault, "accepted lost, most", max(row.lost_ms for row in losses), "ms", "<= 400")


def _kind(disk: Disk) -> str:
    mounts = Path("/proc/mounts").read_text().splitlines()
    return next(row.split()[2] for row in mounts if row.split()[1] == str(disk.path))
