"""The commands `info` and `attach`."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.writer import IndexType, Writer

import seamlog
from seamlog import messages
from seamlog.channels import CHANNELS
from seamlog.cli import run
from seamlog.mcap.batch import BatchWriter
from tests.core.scenarios import SCENARIOS, START_NS, assert_same, picture, write_live

PNG = bytes(cv2.imencode(".png", np.zeros((4, 5), np.uint8))[1])
PLANE = {
    "schema": "seamlog.calibration",
    "kind": "plane",
    "image_width_px": 5,
    "image_height_px": 4,
    "plane_mm_from_px": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "residual_mm": 0,
    "scale_relative_u": 0,
}


@pytest.fixture
def live(tmp_path: Path) -> Path:
    write_live(tmp_path / "live.mcap")
    return tmp_path / "live.mcap"


def test_info_prints_channels(live: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["info", str(live)]) == 0
    text = capsys.readouterr().out
    assert "/table/encoder" in text and "photo/a.jpg" in text and "18" in text


def test_info_as_json(live: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["info", str(live), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "seamlog.info"
    assert {row["topic"]: row["count"] for row in document["channels"]} == {
        "/table/encoder": 18,
        "/camera/image": 6,
    }
    assert document["problems"] == []


def test_info_on_an_unfinished_file_is_a_finding(
    live: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    live.write_bytes(live.read_bytes()[:2000])
    assert run(["info", str(live)]) == 1
    assert "not finished" in capsys.readouterr().out


def test_info_refuses_what_is_no_session(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(b"")
    assert run(["info", str(tmp_path / "x.mcap")]) == 3
    assert run(["info", str(tmp_path / "none.mcap")]) == 3


def test_attach_keeps_everything_and_adds(live: Path, tmp_path: Path) -> None:
    expected = write_live(tmp_path / "other.mcap")
    (tmp_path / "be<a>d.png").write_bytes(PNG)
    (tmp_path / "bead.calibration.json").write_text(json.dumps(PLANE))
    (tmp_path / "wps.pdf").write_bytes(b"%PDF")
    files = [str(tmp_path / name) for name in ("be<a>d.png", "bead.calibration.json", "wps.pdf")]
    assert run(["attach", str(live), *files]) == 0
    with seamlog.open_session(live) as session:
        assert set(session.attachments) == {
            "photo/a.jpg",
            "photo/be_a_d.png",
            "calibration/bead.calibration.json",
            "wps/wps.pdf",
        }
        assert session.attachments["photo/be_a_d.png"].data == PNG
        assert session.attachments["photo/be_a_d.png"].media_type == "image/png"
        assert session.attachments["photo/a.jpg"].data == picture(3)
        assert session.info.recording_id == "test"
        for topic, columns in expected.items():
            assert_same(session.columns(topic), columns)
        assert session.problems == []


def test_a_name_that_is_taken_needs_force(live: Path, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(PNG)
    before = live.read_bytes()
    assert run(["attach", str(live), str(tmp_path / "a.jpg")]) == 2
    assert live.read_bytes() == before
    assert run(["attach", str(live), str(tmp_path / "a.jpg"), "--force"]) == 0
    with seamlog.open_session(live) as session:
        assert list(session.attachments) == ["photo/a.jpg"]
        assert session.attachments["photo/a.jpg"].data == PNG


@pytest.mark.parametrize(
    ("name", "content", "kind", "code"),
    [
        ("a.png", b"no picture", None, 3),
        ("b.calibration.json", b"{}", None, 3),
        ("c.pdf", b"", None, 2),
        ("d.pdf", b"%PDF", "photo", 3),
    ],
)
def test_bad_files_are_refused_and_nothing_changes(
    live: Path, tmp_path: Path, name: str, content: bytes, kind: str | None, code: int
) -> None:
    (tmp_path / name).write_bytes(content)
    before = live.read_bytes()
    arguments = ["attach", str(live), str(tmp_path / name)]
    assert run([*arguments, *(["--as", kind] if kind else [])]) == code
    assert live.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"live.mcap", name}


def test_a_damaged_session_stays_as_it_was(live: Path, tmp_path: Path) -> None:
    (tmp_path / "p.png").write_bytes(PNG)
    data = live.read_bytes()
    place = data.index(picture(2)) + 9
    for damaged in (data[:-500], data[:place] + b"?" + data[place + 1 :]):
        live.write_bytes(damaged)
        assert run(["attach", str(live), str(tmp_path / "p.png")]) == 3
        assert live.read_bytes() == damaged


def recorder_row(topic: str, dropped: int) -> tuple[Any, ...]:
    row = {"stamp_ns": START_NS, "topic": topic, "offered": 100, "dropped": dropped}
    return tuple(row.get(name, 0) for name in CHANNELS["/seamlog/recorder"].field_names)


@pytest.mark.parametrize("dropped", [0, 7])
def test_info_tells_rates_gaps_jitter_bytes_and_drops(
    tmp_path: Path, dropped: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """99 steps of 10 ms, every other one 1 ms late, and one gap of half a second."""
    status = CHANNELS["/seamlog/recorder"]
    stamps = START_NS + np.arange(100) * 10_000_000 + np.arange(100) % 2 * 1_000_000
    stamps[60:] += 500_000_000
    columns = {"stamp_ns": stamps, "position_m": np.zeros(100), "velocity_m_s": np.zeros(100)}
    with BatchWriter(tmp_path / "x.mcap") as writer:
        writer.write("/table/encoder", columns)
        row = messages.encode(status, recorder_row("/table/encoder", dropped))
        writer.write_payloads(status.topic, status, [row], [int(stamps[-1])])
    assert run(["info", str(tmp_path / "x.mcap"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    encoder = next(c for c in document["channels"] if c["topic"] == "/table/encoder")
    assert encoder["gaps"] == 1
    assert encoder["longest_gap_s"] == pytest.approx(0.509, abs=1e-3)
    assert encoder["jitter_s"] == pytest.approx(0.001, rel=0.01)
    assert encoder["size_bytes"] >= 100 * 59
    assert encoder["account"]["dropped"] == dropped
    assert document["complete"] is (dropped == 0)
    assert run(["info", str(tmp_path / "x.mcap")]) == 0
    assert ("NOT complete: 7" in capsys.readouterr().out) == bool(dropped)


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name.startswith("foreign")])
def test_info_counts_bytes_of_foreign_files(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = SCENARIOS[name](tmp_path / "x.mcap")
    assert run(["info", str(tmp_path / "x.mcap"), "--json"]) == 0
    rows = {c["topic"]: c for c in json.loads(capsys.readouterr().out)["channels"]}
    for topic in expected:
        assert rows[topic]["size_bytes"] >= 31 * rows[topic]["count"]
        assert rows[topic]["rate_hz"] == pytest.approx(25.0)


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE])
def test_bytes_of_topics_that_share_chunks_are_exact(
    tmp_path: Path, index: IndexType, capsys: pytest.CaptureFixture[str]
) -> None:
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = Writer(file, chunk_size=5000, index_types=index)
        writer.start()
        channels = [writer.register_channel(topic, "json", 0) for topic in ("/a", "/b")]
        for time in range(500):
            for channel, payload in zip(channels, (b"{}", b'{"x": 1}'), strict=True):
                writer.add_message(channel, time, payload, time)
        writer.finish()  # type: ignore[no-untyped-call]
    assert run(["info", str(tmp_path / "x.mcap"), "--json"]) == 0
    rows = {c["topic"]: c for c in json.loads(capsys.readouterr().out)["channels"]}
    assert [rows[topic]["count"] for topic in ("/a", "/b")] == [500, 500]
    if index == IndexType.NONE:
        assert [rows[topic]["size_bytes"] for topic in ("/a", "/b")] == [500 * 33, 500 * 39]
    assert rows["/a"]["size_bytes"] + rows["/b"]["size_bytes"] <= 500 * 72 + 500
