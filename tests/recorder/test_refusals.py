"""Bad messages are refused, counted and explained; misuse is told at once."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seamlog.errors import InputError, RecordingError, UsageError
from seamlog.recorder import Recorder
from tests.recorder.sessions import read_session

STAMP_NS = 1_767_225_600_000_000_000


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "weld.mcap"


BAD_MESSAGES: list[tuple[Any, ...]] = [
    (-1, 0.1, 0.2),
    (1.5, 0.1, 0.2),
    (2**63, 0.1, 0.2),
    (2**70, 0.1, 0.2),
    (None, 0.1, 0.2),
    ("now", 0.1, 0.2),
    (STAMP_NS, "0.1", 0.2),
    (STAMP_NS, None, 0.2),
    (STAMP_NS, 0.1),
    (STAMP_NS,),
    (),
    (STAMP_NS, 0.1, 0.2, 0.3),
    (STAMP_NS, np.zeros(2), 0.2),
    (STAMP_NS, object(), object()),
]


def test_bad_messages_are_refused_and_harm_nothing(path: Path) -> None:
    with Recorder(path) as recorder:
        encoder = recorder.channel("/table/encoder")
        for i, bad in enumerate(BAD_MESSAGES):
            assert not encoder.put(*bad), bad
            assert encoder.put(STAMP_NS, i, 0.0)
        (account,) = recorder.status().channels
        assert account.refused == len(BAD_MESSAGES)
        assert "position_m" in account.reason
    messages = read_session(path)
    assert [m.values[0] for m in messages["/table/encoder"]] == list(range(len(BAD_MESSAGES)))
    assert any(b"/table/encoder: put(" in m.data for m in messages["/events"])


@pytest.mark.parametrize(
    ("topic", "values"),
    [
        ("/table/command", (1.0, "no")),
        ("/table/command", (1.0,)),
        ("/events", (300, "what")),
        ("/events", (1, None)),
        ("/events", (1,)),
        ("/seam/points", ([1.0], ["a"])),
        ("/camera/image", ("camera", "jpeg", "text")),
        ("/camera/image", ("camera", "jpeg", None)),
        ("/controller/state", ([1.0] * 9,)),
        ("/controller/state", (1.0,)),
        ("/seam/path", (np.zeros(200_000), np.zeros(200_000))),
    ],
)
def test_bad_values_of_other_topics(path: Path, topic: str, values: tuple[Any, ...]) -> None:
    with Recorder(path) as recorder:
        assert not recorder.channel(topic).put(STAMP_NS, *values)
        (account,) = recorder.close().channels
    assert (account.refused, account.accepted) == (1, 0)
    assert account.reason
    assert topic not in read_session(path) or topic == "/events"


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((4, 4), np.float32),
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((0, 4), np.uint8),
        np.zeros(16, np.uint8),
        np.zeros((1, 70_000), np.uint8),
        None,
        b"jpeg",
    ],
)
def test_what_is_no_picture_is_refused(path: Path, image: Any) -> None:
    with Recorder(path) as recorder:
        assert not recorder.log_frame("/camera/image", image)
        assert not recorder.log_frame("/table/encoder", np.zeros((4, 4), np.uint8))
        assert [row.refused for row in recorder.close().channels] == [1, 1]


def test_strict_raises(path: Path) -> None:
    with Recorder(path, strict=True) as recorder:
        encoder = recorder.channel("/table/encoder")
        with pytest.raises(RecordingError, match="/table/encoder"):
            encoder.put(-1, 0.0, 0.0)
        with pytest.raises(RecordingError, match="no topic"):
            recorder.log("/table/speed", value=1.0)
        assert encoder.put(STAMP_NS, 0.0, 0.0)
    with pytest.raises(RecordingError, match="closed"):
        encoder.put(STAMP_NS, 0.0, 0.0)


def test_misuse_that_is_told_at_once(path: Path) -> None:
    with pytest.raises(InputError, match="folder"):
        Recorder(path.parent / "missing" / "weld.mcap")
    with pytest.raises(UsageError, match="index"):
        Recorder(path, meta={"index": "1"})
    assert list(path.parent.iterdir()) == []
    with Recorder(path) as recorder:
        with pytest.raises(UsageError, match="/table/encoder"):
            recorder.channel("/table/encodr")
        with pytest.raises(UsageError, match="recorder itself"):
            recorder.channel("/seamlog/recorder")
        command = recorder.channel("/table/command", {"unit": "V"})
        assert recorder.channel("/table/command") is command
        with pytest.raises(UsageError, match="unit"):
            recorder.channel("/table/command", {"unit": "N"})
    with pytest.raises(UsageError, match="closed"):
        recorder.channel("/table/encoder")
    assert not command.put(STAMP_NS, 1.0, False)
    assert recorder.status() == recorder.close()
