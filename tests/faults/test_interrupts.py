"""Ctrl-C at random places, giant and empty messages: the file is finished and the counts agree."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from seamlog import open_session
from seamlog.recorder import Recorder
from tests.faults.accounts import check_identities, session_stamps
from tests.recorder.sessions import final_accounts, read_session

INTERRUPTED = """
import random, signal, sys, time
import numpy as np
from seamlog.recorder import Recorder

class Interrupt(KeyboardInterrupt):
    pass

def interrupt(*_):
    raise Interrupt

random.seed(int(sys.argv[2]))
image = np.zeros((48, 64), np.uint8)
with Recorder(sys.argv[1]) as recorder:
    put = recorder.channel("/table/encoder").put
    recorder.channel("/events")
    recorder.channel("/camera/image")
    signal.signal(signal.SIGALRM, interrupt)
    end, number, hits = time.monotonic() + 0.5, 0, 0
    while time.monotonic() < end:
        try:
            signal.setitimer(signal.ITIMER_REAL, random.uniform(20e-6, 400e-6))
            while True:
                number += 1
                put(number, number, 0.0)
                if number % 10 == 0:
                    recorder.log("/events", kind=7, detail="x" * (number % 50))
                    recorder.log_frame("/camera/image", image, number)
        except Interrupt:
            hits += 1
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, signal.SIG_IGN)
status = recorder.close()
for row in status.channels:
    print(row.topic, row.offered, row.accepted, row.dropped, row.refused, row.written, row.lost)
print("hits", hits)
"""


@pytest.mark.parametrize("seed", range(2))
def test_interrupts_inside_the_calls(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "weld.mcap"
    command = [sys.executable, "-c", INTERRUPTED, str(path), str(seed)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
    *rows, last = (line.split() for line in done.stdout.splitlines())
    assert int(last[1]) > 100
    messages, accounts = read_session(path), final_accounts(path)
    for topic, *counts in rows:
        offered, accepted, dropped, refused, written, lost = map(int, counts)
        assert offered == accepted + dropped + refused
        assert (accepted, lost) == (written, 0)
        mine = [m for m in messages[topic] if b"the ring is full" not in m.data]
        assert written == len(mine) == accounts[topic].written
        sequences = [m.sequence for m in mine]
        assert sequences == sorted(set(sequences))
    stamps = [m.publish_time_ns for m in messages["/table/encoder"]]
    assert stamps == sorted(set(stamps))
    assert [m.values[0] for m in messages["/table/encoder"]] == [float(s) for s in stamps]


HANDLED = """
import random, signal, sys, time
import numpy as np
from seamlog.recorder import Recorder

random.seed(1)
image = np.zeros((48, 64), np.uint8)
with Recorder(sys.argv[1]) as recorder:
    put, named = recorder.channel("/table/encoder").put, recorder.log
    taken = {topic: [] for topic in ("/table/encoder", "/events", "/camera/image")}
    for topic in taken:
        recorder.channel(topic)
    number = 0

    def act():
        global number
        number += 1
        mine = number
        if put(mine, mine, 0.0):
            taken["/table/encoder"].append(mine)
        number += 1
        mine = number
        if named("/table/encoder", mine, position_m=mine, velocity_m_s=0.0):
            taken["/table/encoder"].append(mine)
        if named("/events", mine, kind=7, detail="x"):
            taken["/events"].append(mine)
        if mine % 50 == 0 and recorder.log_frame("/camera/image", image, mine):
            taken["/camera/image"].append(mine)

    handled = 0

    def handle(*_):
        global handled
        handled += 1
        act()

    signal.signal(signal.SIGALRM, handle)
    signal.setitimer(signal.ITIMER_REAL, 50e-6, 150e-6)
    end = time.monotonic() + 0.7
    while time.monotonic() < end:
        act()
    signal.setitimer(signal.ITIMER_REAL, 0)
print(handled)
for topic, stamps in taken.items():
    print(topic, *stamps)
"""


def test_a_handler_that_logs_too_takes_nothing_from_what_it_interrupts(tmp_path: Path) -> None:
    path = tmp_path / "weld.mcap"
    command = [sys.executable, "-c", HANDLED, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
    handled, *rows = done.stdout.splitlines()
    assert int(handled) > 100
    messages, accounts = read_session(path), final_accounts(path)
    for topic, *stamps in (row.split() for row in rows):
        mine = [m for m in messages[topic] if b"put by" not in m.data and b"full" not in m.data]
        assert sorted(m.publish_time_ns for m in mine) == sorted(map(int, stamps))
        assert [m.sequence for m in mine] == sorted({m.sequence for m in mine})
        assert [m.log_time_ns for m in mine] == sorted(m.log_time_ns for m in mine)
        row = accounts[topic]
        assert row.offered == row.accepted + row.dropped + row.refused
        assert (row.accepted, row.lost) == (len(mine), 0)
    encoder = messages["/table/encoder"]
    assert [m.values[0] for m in encoder] == [float(m.publish_time_ns) for m in encoder]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_recording(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "weld.mcap"
    command = [sys.executable, "-m", "seamlog", "record", "--source", "virtual-cell"]
    command += ["--pace", "realtime", "-o", str(path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        deadline = time.monotonic() + 60
        partial = path.with_name("weld.mcap.part")
        while not (partial.exists() and partial.stat().st_size > 5_000):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        time.sleep(random.Random(number).uniform(0.0, 1.0))
        run.send_signal(number)
        output, errors = run.communicate(timeout=60)
    assert run.returncode in (0, 1), errors
    assert "interrupted" in output
    assert not partial.exists()
    with open_session(path) as session:
        assert session.problems == []
        assert session.metadata["seamlog.recording.end"] == {"ending": "closed"}
    for row in final_accounts(path).values():
        assert row.offered == row.accepted + row.dropped + row.refused
        assert (row.accepted, row.lost) == (row.written, 0)


def test_giant_and_empty_messages(tmp_path: Path) -> None:
    path = tmp_path / "weld.mcap"
    rng = np.random.default_rng(0)
    with Recorder(path) as recorder:
        events = recorder.channel("/events")
        picture = recorder.channel("/camera/image")
        path_points = recorder.channel("/seam/path")
        assert events.put(1, 7, "")
        assert events.put(2, 7, "x" * 900_000)
        assert not events.put(3, 7, "x" * 3_000_000)
        assert picture.put(1, "camera", "jpeg", b"")
        assert picture.put(2, "camera", "jpeg", rng.bytes(6 << 20))
        assert not picture.put(3, "camera", "jpeg", bytes(100 << 20))
        assert recorder.log_frame("/camera/image", np.zeros((1, 1), np.uint8), 4)
        assert not recorder.log_frame("/camera/image", np.zeros((0, 5), np.uint8), 5)
        assert path_points.put(1, [], [])
        assert path_points.put(2, [0.5] * 20_000, [0.25] * 20_000)
    status = recorder.close()
    check_identities(status)
    assert {row.topic: (row.written, row.refused) for row in status.channels} == {
        "/events": (2, 1),
        "/camera/image": (3, 2),
        "/seam/path": (2, 0),
    }
    found = session_stamps(path)
    assert (found["/camera/image"], found["/seam/path"]) == ([1, 2, 4], [1, 2])
    events_found = [m.data for m in read_session(path)["/events"]]
    assert max(map(len, events_found)) > 900_000


def test_a_stopped_loop_holds_nothing_up(tmp_path: Path) -> None:
    script = (
        "import sys, time\n"
        "from seamlog.recorder import Recorder\n"
        "with Recorder(sys.argv[1]) as recorder:\n"
        "    put = recorder.channel('/table/encoder').put\n"
        "    for number in range(300):\n"
        "        assert put(number, 0.0, 0.0)\n"
        "    print('ready', flush=True)\n"
        "    for number in range(300, 600):\n"
        "        assert put(number, 0.0, 0.0)\n"
        "        time.sleep(0.001)\n"
    )
    path = tmp_path / "weld.mcap"
    with subprocess.Popen(
        [sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE, text=True
    ) as loop:
        assert loop.stdout is not None
        assert loop.stdout.readline() == "ready\n"
        os.kill(loop.pid, signal.SIGSTOP)
        deadline = time.monotonic() + 30
        while len(_written(path)) < 300:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        os.kill(loop.pid, signal.SIGCONT)
        assert loop.wait(60) == 0
    assert session_stamps(path)["/table/encoder"] == list(range(600))


def _written(path: Path) -> list[int]:
    with open_session(path) as session:
        if "/table/encoder" not in session.info.channels:
            return []
        return [int(stamp) for stamp in session.columns("/table/encoder")["stamp_ns"]]
