"""The recorder process' work, step by step in this process."""

import os
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from seamlog.channels import ARC_OFF, ARC_ON, EMERGENCY_STOP, FAULT, NOTE
from seamlog.clock import MonotonicClock
from seamlog.recorder.channel import Channel, make_channel
from seamlog.recorder.engine import Engine
from seamlog.recorder.folder import OutTray, Recording
from seamlog.recorder.gate import Gate
from seamlog.recorder.ring import LAST_SYNC_NS, WRITTEN, Ring
from tests.recorder.sessions import parse_status, read_session

MANY = 60_000
"""More messages than a ring holds."""


class Cell:
    """A loop's side and an engine that moves only when it is told to."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "weld.mcap"
        self.clock = MonotonicClock()
        self.folder = folder / "rings"
        self.folder.mkdir()
        start, anchor = self.clock.now_ns(), self.clock.anchor_ns
        recording = Recording("id", str(self.path), start, "paced", anchor, False, 1, {})
        partial = os.open(recording.partial, os.O_RDWR | os.O_CREAT)
        self.engine = Engine(recording, self.folder, partial)
        self._tray = OutTray(self.folder)
        self.channels: list[Channel] = []

    def channel(self, topic: str) -> Channel:
        metadata, number = {"producer": "main"}, len(self.channels) + 1
        made = make_channel(topic, metadata, self._tray, self.clock, self._gate, number)
        self.channels.append(made)
        return made

    def _gate(self, topic: str, ring: Ring) -> Gate:
        return Gate(topic, ring, waits=False, strict=False, is_alive=lambda: True)

    def finish(self) -> None:
        self.engine.finish("closed")


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Cell]:
    made = Cell(tmp_path)
    yield made
    if made.folder.exists():
        made.finish()


def wait_for_sync(cell: Cell, ring: Ring, seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not ring.words[LAST_SYNC_NS]:
        assert time.monotonic() < deadline
        cell.engine.step()
        time.sleep(0.001)


@pytest.mark.parametrize("kind", [ARC_OFF, FAULT, EMERGENCY_STOP])
def test_a_critical_event_brings_everything_to_the_disk_at_once(cell: Cell, kind: int) -> None:
    encoder, events = cell.channel("/table/encoder"), cell.channel("/events")
    cell.engine.step()
    encoder.put(1, 0.0, 0.0)
    events.put(1, kind, "")
    cell.engine.step()
    written = [channel.gate.ring.words[WRITTEN] for channel in (encoder, events)]
    assert written == [1, 1]
    wait_for_sync(cell, encoder.gate.ring)


@pytest.mark.parametrize("kind", [ARC_ON, NOTE])
def test_other_messages_wait_for_their_chunk(cell: Cell, kind: int) -> None:
    events = cell.channel("/events")
    cell.engine.step()
    events.put(1, kind, "")
    before = time.monotonic()
    cell.engine.step()
    if time.monotonic() - before < 0.1:
        assert events.gate.ring.words[WRITTEN] == 0
    time.sleep(0.1)
    cell.engine.step()
    assert events.gate.ring.words[WRITTEN] == 1


def test_a_chunk_closes_when_it_is_large_enough(cell: Cell) -> None:
    encoder = cell.channel("/table/encoder")
    cell.engine.step()
    for i in range(9000):
        assert encoder.put(i, 0.0, 0.0)
    cell.engine.step()
    ring = encoder.gate.ring
    assert ring.words[WRITTEN] >= 2 * (262_144 // ring.stride)


def test_a_step_of_the_wall_clock_is_an_event(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    encoder = cell.channel("/table/encoder")
    encoder.put(1, 0.0, 0.0)
    cell.engine.step()
    true_time = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: true_time() + 3_600_000_000_000)
    cell.engine.step()
    cell.engine.step()
    encoder.put(2, 0.0, 0.0)
    monkeypatch.undo()
    cell.finish()
    messages = read_session(cell.path)
    details = [message.data for message in messages["/events"]]
    assert len([data for data in details if b"+3600.000 s" in data]) == 1
    first, second = messages["/table/encoder"]
    assert first.log_time_ns < second.log_time_ns < first.log_time_ns + 60_000_000_000


def test_accounts_are_written_at_the_start_of_a_gap(cell: Cell) -> None:
    encoder = cell.channel("/table/encoder")
    cell.engine.step()
    for i in range(MANY):
        encoder.put(i, 0.0, 0.0)
    cell.engine.step()
    encoder.put(MANY, 0.0, 0.0)
    cell.engine.step()
    cell.finish()
    messages = read_session(cell.path)
    rows = [parse_status(message.data) for message in messages["/seamlog/recorder"]]
    assert len(rows) >= 2
    assert rows[0].dropped == rows[-1].dropped > 0
    assert rows[-1].offered == MANY + 1
    assert all(row.offered == row.accepted + row.dropped + row.refused for row in rows)
    events = [message.data for message in messages["/events"]]
    assert any(b"/table/encoder: the ring is full" in data for data in events)
    (kind,) = {struct.unpack_from("<B", data, 12)[0] for data in events}
    assert kind == NOTE
    sequences = [message.sequence for message in messages["/table/encoder"]]
    accepted = len(sequences) - 1
    assert sequences == [*range(accepted), MANY]
