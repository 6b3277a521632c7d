"""Pictures that are read into the ring itself: as safe as copied ones, or refused."""

import tempfile
from pathlib import Path
from threading import Thread

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seamlog.clock import SimulatedClock
from seamlog.recorder import Recorder, join
from seamlog.recorder.gate import Gate
from seamlog.recorder.ring import HEAD, RAW_FRAME, SKIP, TAIL, create_ring
from seamlog.recorder.varying import RAW_HEAD, VaryingWriter
from tests.recorder.sessions import read_session

TOPIC = "/camera/image"
SHAPE = (48, 64, 3)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "weld.mcap"


def colours(path: Path) -> list[int]:
    """Mean grey of each picture of a session, to the next ten."""
    found = []
    for message in read_session(path)[TOPIC]:
        jpeg = np.frombuffer(message.data[message.data.index(b"\xff\xd8\xff") :], np.uint8)
        picture = cv2.imdecode(jpeg, cv2.IMREAD_UNCHANGED)
        assert picture is not None
        found.append(round(float(picture.mean()) / 10) * 10)
    return found


def test_lent_and_copied_pictures_look_the_same(path: Path) -> None:
    with Recorder(path, strict=True) as recorder:
        for grey in (10, 20, 30):
            image = recorder.loan_frame(TOPIC, SHAPE)
            assert image.shape == SHAPE
            image[...] = grey
            recorder.log_frame(TOPIC, image)
            assert (image == grey).all()
            recorder.log_frame(TOPIC, np.full(SHAPE, grey + 100, np.uint8))
        account = recorder.status().channels[0]
    assert account.accepted == 6
    assert colours(path) == [10, 110, 20, 120, 30, 130]


def test_what_was_logged_cannot_be_written_again(path: Path) -> None:
    with Recorder(path) as recorder:
        image = recorder.loan_frame(TOPIC, SHAPE)
        image[...] = 50
        assert recorder.log_frame(TOPIC, image)
        with pytest.raises(ValueError, match="read-only"):
            image[...] = 60
        assert recorder.log_frame(TOPIC, image)
    assert colours(path) == [50, 50]


def test_a_loan_that_was_overwritten_is_refused_and_says_why(path: Path) -> None:
    with Recorder(path) as recorder:
        image = recorder.loan_frame(TOPIC, SHAPE)
        image[...] = 50
        assert recorder.log_frame(TOPIC, np.full(SHAPE, 90, np.uint8))
        assert not recorder.log_frame(TOPIC, image)
        again = recorder.loan_frame(TOPIC, SHAPE)
        again[...] = 70
        assert recorder.log_frame(TOPIC, again)
        account = recorder.status().channels[0]
    assert (account.accepted, account.refused) == (2, 1)
    assert "over the loaned picture" in account.reason
    assert colours(path) == [90, 70]


def test_a_loan_that_is_not_logged_leaves_no_trace(path: Path) -> None:
    with Recorder(path) as recorder:
        recorder.loan_frame(TOPIC, SHAPE)[...] = 50
        assert recorder.log_frame(TOPIC, np.full((8, 8), 120, np.uint8))
    assert colours(path) == [120]


def test_where_the_ring_cannot_lend_other_memory_is_lent(path: Path) -> None:
    with Recorder(path) as recorder:
        elsewhere = []
        camera = recorder.channel(TOPIC)
        thread = Thread(target=lambda: elsewhere.append(camera.loan_frame(SHAPE)))
        thread.start()
        thread.join()
        elsewhere.append(recorder.loan_frame("/table/encoder", SHAPE))
        elsewhere.append(recorder.loan_frame("/no/such/topic", SHAPE))
        elsewhere.append(recorder.loan_frame(TOPIC, (40_000, 40_000)))
        assert all(image.base is None and image.flags.writeable for image in elsewhere)
        for grey, image in zip((10, 20, 30), elsewhere, strict=False):
            image[...] = grey
            assert recorder.log_frame(TOPIC, image)
    assert recorder.loan_frame(TOPIC, SHAPE).base is None
    assert colours(path) == [10, 20, 30]


def test_a_joined_loop_borrows_too(path: Path) -> None:
    with Recorder(path), join(path, "camera") as producer:
        image = producer.loan_frame(TOPIC, SHAPE)
        assert image.base is not None
        image[...] = 40
        assert producer.log_frame(TOPIC, image)
    assert colours(path) == [40]


ACTIONS = st.lists(
    st.tuples(st.sampled_from(["copy", "lend", "log lent", "message", "take"]), st.integers(1, 30)),
    max_size=60,
)


@settings(max_examples=150, deadline=None)
@given(ACTIONS)
def test_any_order_of_loans_copies_and_messages_leaves_what_was_accepted(
    actions: list[tuple[str, int]],
) -> None:
    with tempfile.TemporaryDirectory() as name:
        ring = create_ring(Path(name) / "some.ring", 3000, 0)
        gate = Gate(TOPIC, ring, waits=False, strict=False, is_alive=lambda: True)
        writer = VaryingWriter(ring, gate, 3, SimulatedClock(), lambda _, data: (b"", data), 0.75)
        lent: np.ndarray | None = None
        accepted: list[bytes] = []
        taken: list[bytes] = []
        for number, (action, side) in enumerate(actions):
            grey = number % 251
            if action == "copy" and writer.put_frame(number, np.full((side, side), grey, np.uint8)):
                accepted.append(bytes([grey]) * side * side)
            elif action == "lend":
                lent = writer.loan_frame((side, side))
                lent[...] = grey
            elif action == "log lent" and lent is not None:
                wanted = lent.tobytes()
                if writer.put_frame(number, lent):
                    accepted.append(wanted)
                lent = None
            elif action == "message" and writer.put(number, bytes([grey]) * side):
                accepted.append(bytes([grey]) * side)
            elif action == "take":
                taken += records(ring.data, ring.words[TAIL], ring.words[HEAD], ring.capacity)
                ring.words[TAIL] = ring.words[HEAD]
        taken += records(ring.data, ring.words[TAIL], ring.words[HEAD], ring.capacity)
        assert taken == accepted


def records(data: memoryview, tail: int, head: int, capacity: int) -> list[bytes]:
    """Contents of the records between `tail` and `head`."""
    found = []
    while tail < head:
        at = tail % capacity
        if data[at] == SKIP:
            tail += capacity - at
            continue
        size = 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        body = RAW_HEAD.size if data[at] == RAW_FRAME else 31
        found.append(bytes(data[at + body : at + size]))
        tail += size
    return found
