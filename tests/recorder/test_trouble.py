"""A disk that takes no more, and what dead recordings leave behind."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from seamlog import open_session
from seamlog.recorder import Recorder
from seamlog.recorder.folder import abandoned_folders, root

FULL_DISK = """
import json, os, random, resource, sys, time
from seamlog.recorder import Recorder

limit = 3 << 20
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
recorder = Recorder(sys.argv[1])
encoder = recorder.channel("/table/encoder")
accepted = []
for number in range(1_000_000):
    if encoder.put(number, random.random(), random.random()):
        accepted.append(number)
    elif os.path.getsize(sys.argv[1] + ".part") > limit - (1 << 19):
        break
    if number % 1000 == 0:
        time.sleep(0.01)
status = recorder.close()
(row,) = status.channels
document = {"accepted": row.accepted, "written": row.written, "dropped": row.dropped}
document |= {"findings": status.findings, "stamps": accepted, "id": status.recording_id}
print(json.dumps(document))
"""


def test_a_full_disk_leaves_whole_records_and_says_where_the_rest_is(tmp_path: Path) -> None:
    path = tmp_path / "weld.mcap"
    command = [sys.executable, "-c", FULL_DISK, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=90)
    told = json.loads(done.stdout)
    folder = root() / told["id"]
    try:
        assert told["accepted"] == len(told["stamps"]) > told["written"] > 0
        assert told["dropped"] > 0
        assert any(str(folder) in finding for finding in told["findings"])
        assert not path.exists()
        with open_session(tmp_path / "weld.mcap.part") as session:
            stamps = session.columns("/table/encoder")["stamp_ns"]
        assert stamps.tolist() == told["stamps"][: told["written"]]
        assert list(folder.glob("*.ring"))
    finally:
        shutil.rmtree(folder)


def test_rings_of_dead_recordings_are_found_and_kept_while_they_are_of_use(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    script = (
        "import os, sys, time\n"
        "from seamlog.recorder import Recorder\n"
        "recorder = Recorder(sys.argv[1])\n"
        "recorder.channel('/table/encoder').put(1, 0.0, 0.0)\n"
        "print(recorder.id, recorder.recorder_pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "weld.mcap")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as loop:
        assert loop.stdout is not None
        name, pid = loop.stdout.readline().split()
        folder = root() / name
        os.utime(folder, (0, 0))
        assert folder not in abandoned_folders()
        os.kill(int(pid), signal.SIGKILL)
        loop.kill()
    wait_until_free(folder)
    os.utime(folder, (0, 0))
    assert folder in abandoned_folders()
    with Recorder(tmp_path / "other.mcap"):
        assert str(folder) in caplog.text
    (tmp_path / "weld.mcap.part").unlink()
    assert folder not in abandoned_folders()
    assert not folder.exists()


def wait_until_free(folder: Path) -> None:
    """Wait until the killed processes are gone and their lock with them."""
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        os.utime(folder, (0, 0))
        if folder in abandoned_folders():
            return
        time.sleep(0.01)
    raise AssertionError(f"{folder} is still locked")
