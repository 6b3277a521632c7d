"""Several producers: threads and processes log into one recording, each by rings of its own."""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from seamlog.clock import SimulatedClock
from seamlog.errors import RecordingError, UsageError
from seamlog.recorder import Recorder, join
from tests.recorder.sessions import read_session

JOINED = """
import sys, time
from seamlog.recorder import join

path, first, count, name = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
with join(path, name) as producer:
    put = producer.channel("/table/encoder").put
    producer.log("/events", kind=7, detail=f"{name} is here")
    for number in range(first, first + count):
        assert put(number, 0.0, 0.0)
        if number % 100 == 0:
            time.sleep(0.005)
    print(producer.accounts()[0].accepted, flush=True)
"""
FOLLOWING = """
import sys
from seamlog.recorder import join
with join(sys.argv[1]) as producer:
    put = producer.channel("/table/encoder").put
    number = 0
    print("ready", flush=True)
    while put(number, 0.0, 0.0):
        number += 1
        if number % 50 == 0:
            import time
            time.sleep(0.001)
    print(number, flush=True)
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "weld.mcap"


def start(script: str, *arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", script, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def test_processes_log_side_by_side(path: Path) -> None:
    with Recorder(path) as recorder:
        others = [start(JOINED, path, first, 3000, f"p{first}") for first in (10_000, 20_000)]
        mine = recorder.channel("/table/encoder")
        for number in range(1000):
            assert mine.put(number, 0.0, 0.0)
            time.sleep(0.0005)
        assert [other.communicate(timeout=60)[0] for other in others] == ["3000\n", "3000\n"]
    status = recorder.close()
    assert status.is_complete
    counts = {(row.topic, row.producer): row.written for row in status.channels}
    assert counts["/table/encoder", "main"] == 1000
    assert counts["/table/encoder", "p10000"] == counts["/table/encoder", "p20000"] == 3000
    messages = read_session(path)
    found = sorted(m.publish_time_ns for m in messages["/table/encoder"])
    assert found == [*range(1000), *range(10_000, 13_000), *range(20_000, 23_000)]
    times = [m.log_time_ns for m in messages["/table/encoder"]]
    assert times == sorted(times)
    assert times[-1] - times[0] < 60e9
    assert sum(b"is here" in m.data for m in messages["/events"]) == 2


def test_the_end_of_the_recording_ends_all(path: Path) -> None:
    recorder = Recorder(path)
    other = start(FOLLOWING, path)
    assert other.stdout is not None
    assert other.stdout.readline() == "ready\n"
    time.sleep(0.2)
    status = recorder.close()
    accepted = int(other.communicate(timeout=60)[0])
    (row,) = status.channels
    assert row.accepted == row.written + row.lost
    assert (row.written, row.lost) == (accepted, 0)
    assert len(read_session(path)["/table/encoder"]) == accepted


def test_a_killed_producer_leaves_what_it_had(path: Path) -> None:
    with Recorder(path) as recorder:
        other = start(FOLLOWING, path)
        assert other.stdout is not None
        assert other.stdout.readline() == "ready\n"
        time.sleep(0.1)
        other.send_signal(signal.SIGKILL)
        other.communicate()
        assert recorder.log("/events", kind=7, detail="goes on")
    status = recorder.close()
    stamps = [m.publish_time_ns for m in read_session(path)["/table/encoder"]]
    assert stamps == list(range(len(stamps)))
    row = next(row for row in status.channels if row.topic == "/table/encoder")
    assert row.accepted == row.written == len(stamps) > 0


def test_what_cannot_be_joined(path: Path) -> None:
    with pytest.raises(UsageError, match="not being recorded"):
        join(path)
    with (
        Recorder(path, clock=SimulatedClock(), pace="simulated"),
        pytest.raises(UsageError, match="clock of its own"),
    ):
        join(path)


def test_a_joined_producer_after_the_end(path: Path) -> None:
    recorder = Recorder(path)
    producer, strict = join(path, "second"), join(path, "third", strict=True)
    command, picture = producer.channel("/table/command"), producer.channel("/camera/image")
    encoder = strict.channel("/table/encoder")
    assert command.put(1, 0.5, False)
    assert picture.put_frame(1, np.zeros((4, 4), np.uint8))
    status = recorder.close()
    assert not command.put(2, 0.5, False)
    assert not picture.put_frame(2, np.zeros((4, 4), np.uint8))
    with pytest.raises(RecordingError, match="closed"):
        encoder.put(1, 0.0, 0.0)
    with pytest.raises(UsageError, match="closed"):
        producer.channel("/table/reference")
    assert sum(row.written for row in status.channels) == 2
    producer.close()
    strict.close()


def test_many_threads(path: Path) -> None:
    with Recorder(path) as recorder:

        def log(first: int) -> None:
            channel = recorder.channel("/table/encoder")
            for number in range(first, first + 500):
                assert channel.put(number, 0.0, 0.0)
                assert recorder.log("/events", kind=7, detail=str(number))

        threads = [threading.Thread(target=log, args=(n * 1000,), name=f"t{n}") for n in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    status = recorder.close()
    assert status.is_complete
    messages = read_session(path)
    wanted = sorted(n * 1000 + i for n in range(8) for i in range(500))
    assert sorted(m.publish_time_ns for m in messages["/table/encoder"]) == wanted
    assert len(messages["/events"]) == 4000
