"""Sessions of older formats: kept bytes must open, steps bring old columns to today's form."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import seamlog
from seamlog import messages, migrate
from seamlog.channels import ARC_OFF, ARC_ON, CHANNELS
from seamlog.errors import SessionError
from seamlog.mcap.batch import BatchWriter
from seamlog.migrate import Step
from tests.core.scenarios import START_NS, assert_same, encoder_columns, times

KEPT = Path(__file__).parent / "kept" / "format_1.mcap"
"""Written on 2026-11-25 by `write_kept`; never written again."""


def write_kept(path: Path) -> dict[str, dict[str, Any]]:
    """Every kind of content that format 1 has; what must come out of it."""
    encoder = encoder_columns(40)
    command = {"stamp_ns": times(3), "command": np.arange(3.0), "saturated": np.arange(3) > 1}
    events, camera = CHANNELS["/events"], CHANNELS["/camera/image"]
    stamps = times(40).tolist()
    rows = [(stamps[1], ARC_ON, "on"), (stamps[30], ARC_OFF, "off – äöü")]
    with BatchWriter(path) as writer:
        writer.write("/table/encoder", encoder, metadata={"producer": "1"})
        writer.write("/table/command", command, metadata={"unit": "V", "absent": ""})
        payloads = [messages.encode(events, row) for row in rows]
        writer.write_payloads("/events", events, payloads, [row[0] for row in rows])
        frame = messages.encode_image(stamps[2], "camera", "jpeg", b"\xff\xd8\xff\xd9")
        writer.write_payloads("/camera/image", camera, [frame], [stamps[2]])
        writer.attach("photo/a.jpg", b"\xff\xd8\xff\xd9", "image/jpeg", START_NS)
        writer.add_metadata("seamlog.recording", {"id": "kept", "index": "1"})
    return {
        "/table/encoder": encoder,
        "/table/command": command,
        "/events": {"kind": [ARC_ON, ARC_OFF], "detail": ["on", "off – äöü"]},
        "/camera/image": {"stamp_ns": [stamps[2]], "format": ["jpeg"]},
    }


def test_a_session_of_format_1_is_read_for_ever(tmp_path: Path) -> None:
    expected = write_kept(tmp_path / "today.mcap")
    for path in (KEPT, tmp_path / "today.mcap"):
        with seamlog.open_session(path) as session:
            for topic, wanted in expected.items():
                assert_same(session.columns(topic), wanted)
            assert [weld.duration_s for weld in session.welds] == pytest.approx([29 * 0.04])
            assert session.attachments["photo/a.jpg"].data == b"\xff\xd8\xff\xd9"
            assert session.info.recording_id == "kept"
            assert session.problems == []


def test_steps_bring_old_columns_to_todays_form(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if format 2 had renamed a field, and format 3 changed its unit."""

    def renamed(columns: Any) -> Any:
        return {"travel_m" if k == "position_m" else k: v for k, v in columns.items()}

    def in_mm(columns: Any) -> Any:
        return columns | {"travel_m": columns["travel_m"] * 1000}

    steps = (Step(2, "/table/encoder", renamed), Step(3, "/table/encoder", in_mm))
    monkeypatch.setattr(migrate, "STEPS", steps)
    monkeypatch.setattr("seamlog.session.FORMAT", 3)
    with seamlog.open_session(KEPT) as session:
        columns = session.columns("/table/encoder", ["travel_m"])
    wanted = encoder_columns(40)["position_m"] * 1000
    assert set(columns) == {"log_time_ns", "stamp_ns", "travel_m"}
    np.testing.assert_array_equal(columns["travel_m"], wanted)


@pytest.mark.parametrize("version", ["2", "new", "-1"])
def test_a_newer_format_is_refused(tmp_path: Path, version: str) -> None:
    with BatchWriter(tmp_path / "x.mcap") as writer:
        writer.write("/table/encoder", encoder_columns(3))
        recording = {"id": "a", "index": "1", "format": version}
        writer.add_metadata("seamlog.recording", recording)
    with (
        seamlog.open_session(tmp_path / "x.mcap") as session,
        pytest.raises(SessionError, match="update it"),
    ):
        session.columns("/table/encoder")
