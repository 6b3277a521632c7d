"""A disk that takes no more, and what dead recordings leave behind."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from seamlog import open_session
from seamlog.recorder import Recorder
from seamlog.recorder.folder import abandoned_folders, root
from tests.recorder.sessions import read_session

SMALL_FILES = """
import json, random, resource, sys
from seamlog.recorder import Recorder

resource.setrlimit(resource.RLIMIT_FSIZE, (5 << 19, 5 << 19))
recorder = Recorder(sys.argv[1], pace="simulated")
encoder = recorder.channel("/table/encoder")
for number in range(150_000):
    encoder.put(number, random.random(), random.random())
status = recorder.close()
(row,) = status.channels
document = {"accepted": row.accepted, "written": row.written, "lost": row.lost}
print(json.dumps(document | {"findings": status.findings, "files": status.files}))
"""


def test_a_file_that_may_not_grow_ends_whole_and_another_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "weld.mcap"
    command = [sys.executable, "-c", SMALL_FILES, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=90)
    told = json.loads(done.stdout)
    assert (told["accepted"], told["written"], told["lost"]) == (150_000, 150_000, 0)
    names = ["weld.mcap", *(f"weld.{n:04}.mcap" for n in range(2, len(told["files"]) + 1))]
    assert [Path(file).name for file in told["files"]] == names
    assert len(names) >= 2
    assert all("goes on in a new file" in finding for finding in told["findings"])
    with open_session(path) as session:
        assert session.columns("/table/encoder")["stamp_ns"].tolist() == list(range(150_000))
        assert session.problems == []
    counts = [len(read_session(Path(file))["/table/encoder"]) for file in told["files"]]
    assert sum(counts) == 150_000


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
