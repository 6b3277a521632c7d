"""What a recording promises its user, end to end."""

import math
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from seamlog.channels import ARC_OFF, ARC_ON
from seamlog.clock import SimulatedClock
from seamlog.errors import UsageError
from seamlog.recorder import Recorder
from tests.recorder.sessions import (
    final_accounts,
    read_attachments,
    read_metadata,
    read_session,
)

STAMP_NS = 1_767_225_600_000_000_000


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "weld.mcap"


def test_values_come_back_as_they_went_in(path: Path) -> None:
    with Recorder(path) as recorder:
        encoder = recorder.channel("/table/encoder")
        for i in range(5000):
            assert encoder.put(STAMP_NS + i, i * 0.5, -i)
    messages = read_session(path)["/table/encoder"]
    assert [m.values for m in messages] == [(i * 0.5, float(-i)) for i in range(5000)]
    assert [m.publish_time_ns for m in messages] == [STAMP_NS + i for i in range(5000)]
    assert [m.sequence for m in messages] == list(range(5000))


def test_every_topic_of_the_table_can_be_logged(path: Path) -> None:
    square = np.eye(3).ravel()
    given: dict[str, tuple[Any, ...]] = {
        "/camera/image": ("camera", "jpeg", b"\xff\xd8"),
        "/camera/info": (
            *("camera", 480, 640, "plumb_bob", [0.0] * 5, square, square, [0.0] * 12),
            *(0, 0, 0, 0, 0, 0, False),
        ),
        "/table/encoder": (0.1, 0.2),
        "/table/reference": (0.1, 0.2, 0.3),
        "/table/command": (1.5, np.bool_(True)),
        "/controller/state": ([1.0, 2.0],),
        "/estimator/state": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
        "/seam/points": (np.arange(3.0), [4.0, 5.0, 6.0]),
        "/seam/path": ([0.0], [1.0]),
        "/robot/marker": (320, 240),
        "/weld/process": (np.float32(120.0), 22, 7.5),
        "/events": (ARC_ON, "arc on: Stück 7"),
    }
    with Recorder(path, strict=True) as recorder:
        for topic, values in given.items():
            assert recorder.channel(topic).put(STAMP_NS, *values), topic
    messages = read_session(path)
    assert set(given) <= set(messages)
    state = messages["/controller/state"][0].values
    assert state[:2] == (1.0, 2.0)
    assert all(math.isnan(value) for value in state[2:])
    assert "arc on: Stück 7".encode() in messages["/events"][0].data


def test_frames_are_encoded_and_look_as_before(path: Path) -> None:
    rows, columns = np.mgrid[0:120, 0:160]
    grey = (rows + columns // 2).astype(np.uint8)
    colour = np.dstack([grey, 255 - grey, grey // 2])
    with Recorder(path) as recorder:
        assert recorder.log_frame("/camera/image", grey, STAMP_NS)
        assert recorder.log_frame("/camera/image", colour[:, ::-1], STAMP_NS + 1)
    first, second = read_session(path)["/camera/image"]
    for message, image in ((first, grey), (second, colour[:, ::-1])):
        start = message.data.index(b"\xff\xd8\xff")
        jpeg = np.frombuffer(message.data[start:], np.uint8)
        found = cv2.imdecode(jpeg, cv2.IMREAD_UNCHANGED)
        assert found is not None
        assert found.shape == image.shape
        assert np.abs(found.astype(int) - image).mean() < 3
    assert second.publish_time_ns == STAMP_NS + 1


def test_log_takes_fields_by_name(path: Path) -> None:
    with Recorder(path) as recorder:
        assert recorder.log("/table/command", saturated=False, command=2.0)
        assert recorder.log("/events", STAMP_NS, detail="off", kind=ARC_OFF)
        assert recorder.log("/controller/state", values=[1.0])
        assert not recorder.log("/table/command", command=2.0)
        assert not recorder.log("/table/command", command=2.0, saturated=True, power=1)
        assert not recorder.log("/events", detail="off")
        assert not recorder.log("/table/speed", value=1.0)
        status = recorder.close()
    messages = read_session(path)
    assert [m.values for m in messages["/table/command"]] == [(2.0, False)]
    assert {row.topic: row.refused for row in status.channels} == {
        "/table/command": 2,
        "/events": 1,
        "/controller/state": 0,
    }
    assert any("/table/speed" in finding for finding in status.findings)


def test_attachments_and_metadata(path: Path) -> None:
    photo = bytes(range(256)) * 4000
    with Recorder(path, meta={"part": "bracket"}) as recorder:
        recorder.attach("bead.jpg", photo, "image/jpeg")
        recorder.attach("empty", b"", "text/plain")
        recorder.add_metadata("seamlog.truth", {"json": "{}"})
        with pytest.raises(UsageError):
            recorder.attach("", b"", "text/plain")
    assert read_attachments(path) == {
        "bead.jpg": ("image/jpeg", photo),
        "empty": ("text/plain", b""),
    }
    metadata = read_metadata(path)
    assert metadata["seamlog.truth"] == {"json": "{}"}
    facts = metadata["seamlog.recording"]
    assert (facts["part"], facts["id"], facts["index"]) == ("bracket", recorder.id, "1")
    assert metadata["seamlog.recording.end"] == {"ending": "closed"}


def test_channels_belong_to_their_thread(path: Path) -> None:
    with Recorder(path) as recorder:
        encoder = recorder.channel("/table/encoder")
        answers: list[bool] = []

        def intrude() -> None:
            answers.append(encoder.put(STAMP_NS, 1.0, 1.0))
            own = recorder.channel("/table/encoder")
            answers.extend(own.put(STAMP_NS + i, 2.0, 2.0) for i in range(100))

        thread = threading.Thread(target=intrude, name="intruder")
        thread.start()
        for i in range(100):
            assert encoder.put(STAMP_NS + i, 3.0, 3.0)
        thread.join()
        assert answers == [False] + [True] * 100
        status = recorder.close()
    assert sorted(row.producer for row in status.channels) == ["intruder", "main"]
    assert sorted(row.refused for row in status.channels) == [0, 1]
    values = [m.values[0] for m in read_session(path)["/table/encoder"]]
    assert sorted(values) == [2.0] * 100 + [3.0] * 100


def test_a_full_ring_drops_the_new_message_and_counts_it(path: Path) -> None:
    with Recorder(path) as recorder:
        encoder = recorder.channel("/table/encoder")
        os.kill(recorder.recorder_pid, 19)
        answers = [encoder.put(STAMP_NS + i, i, 0.0) for i in range(60_000)]
        os.kill(recorder.recorder_pid, 18)
        status = recorder.close()
    accepted = sum(answers)
    assert answers == [True] * accepted + [False] * (60_000 - accepted)
    assert 0 < accepted < 60_000
    (account,) = status.channels
    assert (account.accepted, account.dropped, account.written) == (
        accepted,
        60_000 - accepted,
        accepted,
    )
    assert (account.first_dropped_sequence, account.last_dropped_sequence) == (accepted, 59_999)
    assert account.ring_high_water == 1.0
    assert not status.is_complete
    row = final_accounts(path)["/table/encoder"]
    assert row.offered == 60_000 == row.accepted + row.dropped + row.refused
    assert row.accepted == row.written + row.lost == len(read_session(path)["/table/encoder"])


def test_a_simulated_source_waits_instead(path: Path) -> None:
    clock = SimulatedClock()
    with Recorder(path, clock=clock, pace="simulated") as recorder:
        encoder = recorder.channel("/table/encoder")
        for i in range(100_000):
            clock.advance_to(STAMP_NS + i)
            assert encoder.put(STAMP_NS + i, i, 0.0)
        for i in range(100):
            assert recorder.log_frame("/camera/image", np.full((1080, 1920), i, np.uint8))
        assert recorder.close().is_complete
    messages = read_session(path)
    encoder_messages = messages["/table/encoder"]
    assert [m.log_time_ns for m in encoder_messages] == [STAMP_NS + i for i in range(100_000)]
    assert len(messages["/camera/image"]) == 100


def test_the_same_simulation_gives_the_same_messages(tmp_path: Path) -> None:
    sessions = []
    for name in ("one.mcap", "two.mcap"):
        clock = SimulatedClock()
        with Recorder(tmp_path / name, clock=clock, pace="simulated") as recorder:
            encoder = recorder.channel("/table/encoder")
            for i in range(300):
                clock.advance_to(STAMP_NS + i * 10_000_000)
                encoder.put(clock.now_ns(), i, 0.0)
        sessions.append(read_session(tmp_path / name))
    assert sessions[0] == sessions[1]


def test_a_forked_child_takes_no_part(path: Path) -> None:
    script = """
import os, sys
from seamlog.recorder import Recorder
with Recorder(sys.argv[1]) as recorder:
    encoder = recorder.channel("/table/encoder")
    encoder.put(1, 1.0, 1.0)
    child = os.fork()
    if not child:
        os._exit(int(encoder.put(2, 2.0, 2.0) or recorder.log("/table/command", command=1.0)))
    assert os.waitpid(child, 0)[1] == 0
    encoder.put(3, 3.0, 3.0)
"""
    subprocess.run([sys.executable, "-c", script, str(path)], check=True, timeout=60)
    assert [m.publish_time_ns for m in read_session(path)["/table/encoder"]] == [1, 3]


def test_status_runs_along(path: Path) -> None:
    with Recorder(path) as recorder:
        encoder = recorder.channel("/table/encoder")
        encoder.put(STAMP_NS, 1.0, 1.0)
        deadline = time.monotonic() + 30
        while not recorder.status().channels[0].written and time.monotonic() < deadline:
            time.sleep(0.02)
        (account,) = recorder.status().channels
        assert (account.accepted, account.written, account.waiting) == (1, 1, 0)
        assert recorder.status().is_recording
    assert not recorder.status().is_recording


def test_the_recorder_process_stays_away_from_a_loop_that_claims_a_processor(
    tmp_path: Path,
) -> None:
    script = (
        "import os, sys\n"
        "from contextlib import suppress\n"
        "from seamlog.recorder import Recorder\n"
        "os.sched_setaffinity(0, {int(sys.argv[2])})\n"
        "with suppress(PermissionError):\n"
        "    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))\n"
        "with Recorder(sys.argv[1]) as recorder:\n"
        "    pid = recorder.recorder_pid\n"
        "    print(os.sched_getscheduler(pid), *os.sched_getaffinity(pid))\n"
    )
    own, *others = sorted(os.sched_getaffinity(0))
    if not others:
        pytest.skip("one processor has no other")
    command = [sys.executable, "-c", script, str(tmp_path / "weld.mcap"), str(own)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
    policy, *processors = map(int, done.stdout.split())
    assert policy == os.SCHED_OTHER
    assert own not in processors
