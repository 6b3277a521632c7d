"""Snapshot mode: only what is around a trigger is written, every message is accounted for."""

import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from seamlog.clock import SimulatedClock
from seamlog.errors import UsageError
from seamlog.messages import layout
from seamlog.recorder import Recorder, Snapshot, Status
from seamlog.recorder.recovery import recover
from seamlog.recorder.ring import RECORD
from seamlog.recorder.trigger_rule import RuleWatch, parse_rule
from tests.recorder.sessions import Read, final_accounts, read_session

MS = 1_000_000
START_NS = 1_767_225_600_000_000_000


class SimulatedLoop:
    """100 Hz of encoder and reference by a clock of its own: 10 ms per step."""

    def __init__(self, path: Path, snapshot: Snapshot) -> None:
        self.path = path
        self.clock = SimulatedClock(START_NS)
        self.recorder = Recorder(path, clock=self.clock, pace="simulated", snapshot=snapshot)
        self.encoder = self.recorder.channel("/table/encoder")
        self.reference = self.recorder.channel("/table/reference")
        self.events = self.recorder.channel("/events")
        self.step = 0

    def run(self, steps: int, error_m: float = 0.0) -> None:
        for _ in range(steps):
            self.clock.advance_to(START_NS + self.step * 10 * MS)
            self.reference.put(self.step, 0.001 * self.step, 0.0, 0.0)
            self.encoder.put(self.step, 0.001 * self.step - error_m, 0.0)
            self.step += 1
        self.settle()

    def settle(self) -> None:
        """Let the recorder process take in what there is, as it does in the pace of real time."""
        deadline = time.monotonic() + 30
        rings = [channel.gate.ring for channel in (self.encoder, self.reference, self.events)]
        while any(ring.words[0] != ring.words[16] for ring in rings):
            assert time.monotonic() < deadline
            time.sleep(0.005)
        time.sleep(0.03)

    def close(self) -> Status:
        status = self.recorder.close()
        for row in status.channels:
            assert row.accepted == row.written + row.lost + row.discarded
            assert (row.lost, row.dropped, row.refused) == (0, 0, 0)
        return status


def stamps(messages: dict[str, list[Read]], topic: str = "/table/encoder") -> list[int]:
    return [m.publish_time_ns for m in messages.get(topic, [])]


def check_window(found: list[int], first: int, last: int, slack: int = 2) -> None:
    """A run without gaps from `first`, as far as it was still there, to `last`, in steps."""
    assert found == list(range(found[0], found[-1] + 1))
    assert first - 1 <= found[0] <= first + slack
    assert last - 1 <= found[-1] <= last + 1


@pytest.fixture
def loop(tmp_path: Path) -> SimulatedLoop:
    rules = ("abs(error) > 1 mm",)
    return SimulatedLoop(tmp_path / "weld.mcap", Snapshot(before_s=2.0, after_s=1.0, rules=rules))


def run_in_parts(loop: SimulatedLoop, steps: int) -> None:
    for _ in range(steps // 50):
        loop.run(50)


def test_without_a_trigger_nothing_is_written(loop: SimulatedLoop) -> None:
    run_in_parts(loop, 600)
    status = loop.close()
    assert all(row.written == 0 for row in status.channels)
    assert stamps(read_session(loop.path)) == []
    assert status.is_complete


def test_an_event_triggers(loop: SimulatedLoop) -> None:
    run_in_parts(loop, 600)
    loop.events.put(loop.step, 3, "arc lost")
    run_in_parts(loop, 600)
    status = loop.close()
    messages = read_session(loop.path)
    check_window(stamps(messages), 400, 699)
    check_window(stamps(messages, "/table/reference"), 400, 699)
    assert any(b"arc lost" in m.data for m in messages["/events"])
    assert any(b"snapshot: event FAULT" in m.data for m in messages["/events"])
    assert status.channels[0].discarded > 0


def test_an_event_of_another_kind_does_not(loop: SimulatedLoop) -> None:
    loop.events.put(0, 1, "arc on")
    run_in_parts(loop, 300)
    loop.close()
    assert stamps(read_session(loop.path)) == []


def test_a_call_triggers(loop: SimulatedLoop) -> None:
    run_in_parts(loop, 500)
    loop.recorder.trigger("operator")
    time.sleep(0.1)
    run_in_parts(loop, 300)
    loop.close()
    messages = read_session(loop.path)
    check_window(stamps(messages), 300, 599)
    assert any(b"snapshot: operator" in m.data for m in messages["/events"])


def test_a_rule_triggers_and_goes_on_while_it_holds(loop: SimulatedLoop) -> None:
    run_in_parts(loop, 500)
    for _ in range(4):
        loop.run(50, error_m=-0.0011)
    run_in_parts(loop, 500)
    loop.close()
    messages = read_session(loop.path)
    check_window(stamps(messages), 300, 799)
    told = [m.data for m in messages["/events"] if b"abs(error) > 1 mm" in m.data]
    assert len(told) == 1


def test_two_snapshots_in_one_file(loop: SimulatedLoop) -> None:
    for _ in range(2):
        run_in_parts(loop, 600)
        loop.events.put(loop.step, 5, "look")
        run_in_parts(loop, 400)
    loop.close()
    found = stamps(read_session(loop.path))
    gap = int(np.argmax(np.diff(found)))
    check_window(found[: gap + 1], 400, 699)
    check_window(found[gap + 1 :], 1400, 1699)


def test_memory_bounds_what_is_kept(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    snapshot = Snapshot(before_s=3000.0, after_s=0.0, memory_bytes=1 << 20)
    loop = SimulatedLoop(tmp_path / "weld.mcap", snapshot)
    for _ in range(30):
        loop.run(600)
    loop.recorder.trigger("end")
    time.sleep(0.2)
    loop.close()
    found = stamps(read_session(loop.path))
    assert found == list(range(found[0], 18_000))
    assert 0 < len(found) < 18_000
    assert "memory of the snapshot is too small" in caplog.text


def test_the_death_of_the_loop_is_a_trigger(tmp_path: Path) -> None:
    script = """
import os, sys, time
from seamlog.recorder import Recorder, Snapshot
recorder = Recorder(sys.argv[1], snapshot=Snapshot(before_s=60.0))
encoder = recorder.channel("/table/encoder")
for number in range(500):
    encoder.put(number, 0.0, 0.0)
    time.sleep(0.001)
os.kill(os.getpid(), 9)
"""
    path = tmp_path / "weld.mcap"
    done = subprocess.run([sys.executable, "-c", script, str(path)], check=False, timeout=60)
    assert done.returncode == -signal.SIGKILL
    deadline = time.monotonic() + 30
    while not path.exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    messages = read_session(path)
    assert stamps(messages) == list(range(500))
    assert any(b"snapshot: the loop died" in m.data for m in messages["/events"])


def test_loop_and_recorder_killed_in_a_snapshot(tmp_path: Path) -> None:
    script = """
import os, sys, time
from seamlog.recorder import Recorder, Snapshot
recorder = Recorder(sys.argv[1], snapshot=Snapshot(before_s=60.0, after_s=60.0))
encoder = recorder.channel("/table/encoder")
for number in range(500):
    encoder.put(number, 0.0, 0.0)
    time.sleep(0.001)
    if number == 200:
        recorder.trigger("by hand")
os.kill(recorder.recorder_pid, 9)
os.kill(os.getpid(), 9)
"""
    path = tmp_path / "weld.mcap"
    done = subprocess.run([sys.executable, "-c", script, str(path)], check=False, timeout=60)
    assert done.returncode == -signal.SIGKILL
    found = recover(path)
    assert found.is_complete
    assert stamps(read_session(path)) == list(range(500))
    row = final_accounts(path)["/table/encoder"]
    assert (row.accepted, row.written, row.lost) == (500, 500, 0)


@pytest.mark.parametrize(
    ("text", "field", "bound"),
    [
        ("abs(error) > 1 mm", "position_m", 1e-3),
        ("error <= -0.5mm", "position_m", -0.5e-3),
        ("/weld/process.current_a < 20 A", "current_a", 20.0),
        ("abs( /table/encoder.velocity_m_s ) >= 12 mm/s", "velocity_m_s", 0.012),
        ("/table/command.command > 3", "command", 3.0),
    ],
)
def test_rules(text: str, field: str, bound: float) -> None:
    rule = parse_rule(text)
    assert rule.field == field
    assert rule.bound == pytest.approx(bound)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "error",
        "abs(error > 1 mm",
        "error) > 1 mm",
        "error > 1 A",
        "error > 1",
        "error > one mm",
        "/weld/process.nothing > 1",
        "/camera/image.data > 1",
        "/nowhere.x > 1",
        "__import__('os').system('x') > 1 mm",
    ],
)
def test_what_is_no_rule(text: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        Recorder(tmp_path / "weld.mcap", snapshot=Snapshot(rules=(text,)))
    assert list(tmp_path.iterdir()) == []


def test_the_error_waits_for_its_reference(tmp_path: Path) -> None:
    watch = RuleWatch(parse_rule("abs(error) > 1 mm"))
    reference, encoder = "/table/reference", "/table/encoder"
    assert watch.span(encoder, rows(encoder, [(10, 0.0), (20, 0.0), (30, 0.0)])) is None
    assert watch.span(reference, rows(reference, [(5, 0.0), (15, 0.002)])) is None
    assert watch.span(reference, rows(reference, [(40, 0.002)])) == (20, 30)
    assert watch.span(encoder, rows(encoder, [(50, 0.0)])) is None
    assert watch.span(reference, rows(reference, [(60, 0.0)])) == (50, 50)


def rows(topic: str, values: list[tuple[int, float]]) -> NDArray[np.uint8]:
    body = struct.Struct("<4x" + layout(topic).codes)
    rest = len(layout(topic).names) - 2
    packed = [
        RECORD.pack(5, 0, 3, 0, time_ns, 0) + body.pack(0, position, *[0.0] * rest)
        for time_ns, position in values
    ]
    return np.frombuffer(b"".join(packed), np.uint8).reshape(len(values), -1)


@pytest.mark.parametrize(
    "values",
    [{"before_s": 0}, {"after_s": -1}, {"events": ("SOON",)}, {"memory_bytes": 5}],
)
def test_values_that_make_no_sense(values: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        Snapshot(**values)  # type: ignore[arg-type]


def test_triggers_are_for_snapshot_mode(tmp_path: Path) -> None:
    with Recorder(tmp_path / "weld.mcap") as recorder, pytest.raises(UsageError, match="snapshot"):
        recorder.trigger("now")
