"""The ring against a model: whatever is put and taken in any order, accounts and file agree."""

import os
import tempfile
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seamlog.clock import SimulatedClock
from seamlog.errors import SpaceMissing
from seamlog.messages import layout
from seamlog.recorder.feeds import Feed, FixedFeed
from seamlog.recorder.fixed import fixed_put, fixed_ring
from seamlog.recorder.folder import Recording
from seamlog.recorder.gate import Gate
from seamlog.recorder.mcap_writer import SessionFile
from seamlog.recorder.ring import HEAD, TAIL, Ring, create_ring, open_ring
from seamlog.recorder.varying import VaryingWriter
from seamlog.recorder.varying_feed import VaryingFeed
from tests.recorder.sessions import read_session

CHANNEL_ID = 3
STRIDE = 59
SLOTS = 7


def make_gate(topic: str, ring: Ring) -> Gate:
    return Gate(topic, ring, waits=False, strict=False, is_alive=lambda: True)


@contextmanager
def open_session_file(topic: str) -> Iterator[tuple[Path, SessionFile]]:
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "ring.mcap"
        recording = Recording("id", str(path), 0, "paced", None, False, 1, {})
        flags = os.O_RDWR | os.O_CREAT
        file = SessionFile(recording, path.parent, os.open(recording.partial, flags))
        file.add_channel(topic, CHANNEL_ID, {})
        try:
            yield path, file
        finally:
            file.finish()


def finish(path: Path, file: SessionFile, feed: Feed) -> None:
    assert not feed.pump(0.0, flush=True)
    assert file.finish() == []


FIELDS = {"position_m": 0.0, "velocity_m_s": 0.0}
actions = st.lists(st.one_of(st.integers(1, 12), st.just(0), st.just(-1)), max_size=40)
"""n > 0: put n messages; 0: take what is there; -1: put one that is not valid."""


@settings(max_examples=60, deadline=None)
@given(actions)
def test_fixed_ring_behaves_as_a_bounded_queue(steps: list[int]) -> None:
    with open_session_file("/table/encoder") as (path, file):
        form = layout("/table/encoder")
        ring = fixed_ring(path.with_suffix(".ring"), CHANNEL_ID, form, SLOTS * STRIDE)
        assert (ring.slots, ring.stride) == (SLOTS, STRIDE)
        gate = make_gate("/table/encoder", ring)
        put, put_named, _ = fixed_put(ring, gate, form, SimulatedClock())
        feed = FixedFeed(CHANNEL_ID, "/table/encoder", "main", open_ring(ring_path(path)), file)
        queue: deque[int] = deque()
        kept, offered, refused = [], 0, 0
        for step in steps:
            if step == 0:
                feed.pump(0.0, flush=True)
                kept += list(queue)
                queue.clear()
            elif step == -1:
                assert not (put(-5, 0.0, 0.0) if offered % 2 else put_named(-5, FIELDS))
                # A full ring drops unseen, and the number that it would have had is used up.
                refused += len(queue) < SLOTS
                offered += len(queue) == SLOTS
            for _ in range(max(step, 0)):
                if offered % 2:
                    accepted = put(offered, offered * 0.5, 0.0)
                else:
                    fields = {"velocity_m_s": 0.0, "position_m": offered * 0.5}
                    accepted = put_named(offered, fields)
                assert accepted == (len(queue) < SLOTS)
                if accepted:
                    queue.append(offered)
                offered += 1
        kept += list(queue)
        finish(path, file, feed)
        account = feed.account()
        assert account.offered == offered + refused
        assert (account.accepted, account.refused) == (len(kept), refused)
        assert (account.written, account.lost, account.waiting) == (len(kept), 0, 0)
        messages = read_session(path).get("/table/encoder", [])
        assert [(m.sequence, m.publish_time_ns, m.values[0]) for m in messages] == [
            (n, n, n * 0.5) for n in kept
        ]


def ring_path(path: Path) -> Path:
    return path.with_suffix(".ring")


sizes = st.lists(st.one_of(st.integers(1, 700), st.just(0), st.just(-1)), max_size=40)
"""n > 0: put a message of n bytes; 0: take what is there; -1: put one that is not valid."""


@settings(max_examples=100, deadline=None)
@given(sizes)
def test_varying_ring_loses_nothing_that_it_accepted(steps: list[int]) -> None:
    with open_session_file("/events") as (path, file):
        ring = create_ring(ring_path(path), 2000, 0)
        gate = make_gate("/events", ring)
        writer = VaryingWriter(ring, gate, CHANNEL_ID, SimulatedClock(), encode_block, 1.0)
        feed = VaryingFeed(CHANNEL_ID, "/events", "main", open_ring(ring_path(path)), file)
        kept: list[tuple[int, int]] = []
        offered = refused = 0
        for step in steps:
            if step == 0:
                feed.pump(0.0, flush=True)
                assert ring.words[TAIL] == ring.words[HEAD]
            elif step == -1:
                assert not writer.put(offered, "no bytes")
                refused += 1
            else:
                if writer.put(offered, bytes([offered % 256]) * step):
                    kept.append((offered, step))
                offered += 1
        finish(path, file, feed)
        account = feed.account()
        assert account.offered == offered + refused
        assert account.accepted == account.written == len(kept)
        messages = read_session(path).get("/events", [])
        found = [(m.sequence, len(m.data)) for m in messages]
        assert found == kept
        assert all(m.data == bytes([m.sequence % 256]) * len(m.data) for m in messages)


def encode_block(stamp_ns: int, block: bytes) -> tuple[bytes, memoryview]:
    return b"", memoryview(block)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 900))
def test_a_message_of_the_allowed_size_always_fits_into_an_empty_ring(size: int) -> None:
    with open_session_file("/events") as (path, file):
        ring = create_ring(ring_path(path), 2000, 0)
        gate = make_gate("/events", ring)
        writer = VaryingWriter(ring, gate, CHANNEL_ID, SimulatedClock(), encode_block, 1.0)
        feed = VaryingFeed(CHANNEL_ID, "/events", "main", ring, file)
        for i in range(20):
            assert writer.put(i, bytes(size))
            feed.pump(0.0, flush=True)
        finish(path, file, feed)


def test_a_damaged_slot_is_lost_and_counted_and_the_rest_is_kept(tmp_path: Path) -> None:
    with open_session_file("/table/encoder") as (path, file):
        form = layout("/table/encoder")
        ring = fixed_ring(ring_path(path), CHANNEL_ID, form)
        gate = make_gate("/table/encoder", ring)
        put, _, _ = fixed_put(ring, gate, form, SimulatedClock())
        feed = FixedFeed(CHANNEL_ID, "/table/encoder", "main", open_ring(ring_path(path)), file)
        for i in range(10):
            put(i, 0.0, 0.0)
        ring.data[4 * STRIDE] = 77
        finish(path, file, feed)
        account = feed.account()
        assert (account.accepted, account.written, account.lost) == (10, 9, 1)
        stamps = [m.publish_time_ns for m in read_session(path)["/table/encoder"]]
        assert stamps == [0, 1, 2, 3, 5, 6, 7, 8, 9]


def test_too_little_space_is_told_with_the_size_needed(tmp_path: Path) -> None:
    with pytest.raises(SpaceMissing, match=r"needs 1099511627776 MiB"):
        create_ring(tmp_path / "huge.ring", 1 << 60, 0)
    assert not (tmp_path / "huge.ring").exists()


def test_what_is_no_ring_is_not_mapped(tmp_path: Path) -> None:
    path = tmp_path / "some.ring"
    for content in (b"", b"short", bytes(5000)):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="not a ring"):
            open_ring(path)
