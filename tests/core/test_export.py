"""Sessions to the formats of others and back, value by value."""

import csv
import json
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy.io

import seamlog
from seamlog import messages
from seamlog.channels import CHANNELS, NOTE
from seamlog.cli import run
from seamlog.export import parts
from seamlog.mcap.batch import BatchWriter
from tests.core.scenarios import SCENARIOS, START_NS, assert_same, encoder_columns, times

ROWS = 2000


def jpeg(level: int) -> bytes:
    return bytes(cv2.imencode(".jpg", np.full((48, 64, 3), level, np.uint8))[1])


@pytest.fixture
def session_path(tmp_path: Path) -> Path:
    path = tmp_path / "weld.mcap"
    stamps = times(ROWS)
    events, camera = CHANNELS["/events"], CHANNELS["/camera/image"]
    texts = ["=1+1", "-plain", 'a, "b"\nc', "ä"]
    with BatchWriter(path) as writer:
        writer.write("/table/encoder", encoder_columns(ROWS), metadata={"unit": "m"})
        state = {"stamp_ns": stamps[:5], "values": np.arange(40.0).reshape(5, 8)}
        writer.write("/controller/state", state, metadata={"names": "[]"})
        payloads = [
            messages.encode(events, (int(stamps[at]), NOTE, text)) for at, text in enumerate(texts)
        ]
        writer.write_payloads("/events", events, payloads, stamps[:4])
        lines = [np.arange(float(count)) for count in (0, 1, 3)]
        seam = CHANNELS["/seam/path"]
        paths = [
            messages.encode(seam, (int(t), x, -x)) for t, x in zip(stamps, lines, strict=False)
        ]
        writer.write_payloads("/seam/path", seam, paths, stamps[:3])
        frames = [
            messages.encode_image(int(stamps[at]) + 1, "c", "jpeg", jpeg(20 * at))
            for at in range(5)
        ]
        writer.write_payloads("/camera/image", camera, frames, stamps[:5])
    return path


def columns(path: Path, topic: str) -> dict[str, Any]:
    with seamlog.open_session(path) as session:
        return session.columns(topic)


def export(session_path: Path, name: str, *more: str) -> Path:
    output = session_path.parent / name
    assert run(["export", str(session_path), "-o", str(output), *more]) == 0
    return output


@pytest.mark.parametrize("part_bytes", [1 << 30, 20_000])
def test_parquet_holds_every_value(
    session_path: Path, part_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts, "_PART_BYTES", part_bytes)
    folder = export(session_path, "tables", "--format", "parquet")
    for topic in ("/table/encoder", "/controller/state", "/events", "/seam/path", "/camera/image"):
        table = pq.read_table(folder / f"{topic[1:].replace('/', '.')}.parquet")
        wanted = columns(session_path, topic)
        assert table.column_names == list(wanted)
        for name, column in wanted.items():
            found = table[name].to_pylist()
            assert [np.asarray(value).tolist() for value in found] == [
                np.asarray(value).tolist() for value in column
            ]
    schema = pq.read_schema(folder / "table.encoder.parquet")
    assert schema.field("position_m").metadata == {b"unit": b"m"}
    assert schema.metadata[b"topic"] == b"/table/encoder"


def test_csv_holds_every_value(session_path: Path) -> None:
    table = export(session_path, "e.csv", "--topic", "/table/encoder")
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    wanted = columns(session_path, "/table/encoder")
    assert [int(row["stamp_ns"]) for row in rows] == wanted["stamp_ns"].tolist()
    assert [float(row["position_m"]) for row in rows] == wanted["position_m"].tolist()


def test_texts_that_look_like_formulas_are_quoted_in_csv(session_path: Path) -> None:
    table = export(session_path, "e.csv", "--topic", "/events")
    with table.open(newline="") as file:
        details = [row["detail"] for row in csv.DictReader(file)]
    assert details == ["'=1+1", "'-plain", 'a, "b"\nc', "ä"]


def test_an_exported_table_imports_again_value_by_value(session_path: Path) -> None:
    mapping = session_path.parent / "map.toml"
    mapping.write_text(
        '[time]\ncolumn = "stamp_ns"\nunit = "ns"\n[channels."/table/encoder".fields]\n'
        'position_m = { column = "position_m" }\nvelocity_m_s = { column = "velocity_m_s" }\n'
    )
    wanted = columns(session_path, "/table/encoder")
    for kind in ("csv", "parquet"):
        table = export(session_path, f"e.{kind}", "--topic", "/table/encoder")
        back = session_path.parent / f"{kind}.mcap"
        assert run(["import", str(table), "--map", str(mapping), "-o", str(back)]) == 0
        assert_same(columns(back, "/table/encoder"), wanted)


def test_mat_holds_every_value(session_path: Path) -> None:
    found = scipy.io.loadmat(export(session_path, "w.mat"), squeeze_me=True)
    wanted = columns(session_path, "/table/encoder")
    encoder = found["table_encoder"]
    assert encoder["stamp_ns"].item().tolist() == wanted["stamp_ns"].tolist()
    assert encoder["position_m"].item().tolist() == wanted["position_m"].tolist()
    assert found["controller_state"]["values"].item().shape == (5, 8)
    assert "camera_image" not in found
    assert found["events"]["detail"].item().tolist()[:2] == ["=1+1", "-plain"]
    assert str(encoder["units"].item()["position_m"]) == "m"


@pytest.mark.parametrize("name", ["v.mp4", "v.mkv"])
def test_video_keeps_pictures_and_their_times(session_path: Path, name: str) -> None:
    with av.open(str(export(session_path, name))) as container:
        frames = list(container.decode(video=0))
        stream: Any = container.streams.video[0]
        times_s = [float(frame.pts * stream.time_base) for frame in frames if frame.pts is not None]
        levels = [frame.to_ndarray(format="bgr24").mean() for frame in frames]
    np.testing.assert_allclose(times_s, 0.04 * np.arange(5), atol=1e-3)
    np.testing.assert_allclose(levels, 20 * np.arange(5), atol=1.5)


def write_pictures(path: Path, pictures: list[Any]) -> Path:
    camera = CHANNELS["/camera/image"]
    stamps = times(len(pictures))
    payloads = [
        messages.encode_image(int(stamp), "c", "jpeg", bytes(cv2.imencode(".jpg", picture)[1]))
        for stamp, picture in zip(stamps, pictures, strict=True)
    ]
    with BatchWriter(path) as writer:
        writer.write_payloads("/camera/image", camera, payloads, stamps)
    return path


def test_video_of_odd_size_loses_no_pixel_and_keeps_colours(tmp_path: Path) -> None:
    picture = np.zeros((47, 63, 3), np.uint8)
    picture[:, :32], picture[:, 32:] = (200, 60, 30), (20, 90, 220)
    path = write_pictures(tmp_path / "x.mcap", [picture] * 3)
    with av.open(str(export(path, "v.mp4"))) as container:
        frame = next(iter(container.decode(video=0))).to_ndarray(format="bgr24")
    assert frame.shape == (48, 64, 3)
    np.testing.assert_allclose(frame[10, 5], (200, 60, 30), atol=6)
    np.testing.assert_allclose(frame[46, 62], (20, 90, 220), atol=6)


def test_pictures_of_several_sizes_are_no_video(tmp_path: Path) -> None:
    pictures = [np.zeros((48, 64, 3), np.uint8), np.zeros((24, 32, 3), np.uint8)]
    path = write_pictures(tmp_path / "x.mcap", pictures)
    assert run(["export", str(path), "-o", str(tmp_path / "v.mp4")]) == 6
    assert not (tmp_path / "v.mp4").exists()
    with av.open(str(export(path, "v.mkv"))) as container:
        shapes = [frame.to_ndarray(format="bgr24").shape for frame in container.decode(video=0)]
    assert shapes == [(48, 64, 3), (24, 32, 3)]


def test_other_pictures_are_not_passed_off_as_motion_jpeg(session_path: Path) -> None:
    camera = CHANNELS["/camera/image"]
    png = bytes(cv2.imencode(".png", np.zeros((48, 64, 3), np.uint8))[1])
    kinds = [("jpeg", jpeg(9)), ("png", png)]
    payloads = [messages.encode_image(START_NS + at, "c", *kinds[at]) for at in range(2)]
    path = session_path.parent / "mixed.mcap"
    with BatchWriter(path) as writer:
        writer.write_payloads("/camera/image", camera, payloads, times(2))
    assert run(["export", str(path), "-o", str(path.parent / "v.mkv")]) == 6
    with av.open(str(export(path, "v.mp4"))) as container:
        assert len(list(container.decode(video=0))) == 2


def test_motion_jpeg_survives_the_way_there_and_back(session_path: Path) -> None:
    back = session_path.parent / "back.mcap"
    assert run(["import", str(export(session_path, "v.mkv")), "-o", str(back)]) == 0
    with seamlog.open_session(session_path) as one, seamlog.open_session(back) as other:
        assert [frame.data for frame in one.frames()] == [frame.data for frame in other.frames()]
        shift = np.abs(one.frames().stamps_ns - other.frames().stamps_ns)
    assert shift.max() <= 1_000_000


def test_a_range_of_time_is_exported(session_path: Path) -> None:
    words = ("--topic", "/table/encoder", "--from", "0.4", "--to", "0.8")
    rows = pq.read_table(export(session_path, "e.parquet", *words))["stamp_ns"].to_pylist()
    assert rows == times(ROWS)[10:20].tolist()
    moment = str(np.datetime64(START_NS + 400_000_000, "ns")) + "Z"
    words = ("--topic", "/table/encoder", "--from", moment, "--to", "0.8")
    again = pq.read_table(export(session_path, "e2.parquet", *words))["stamp_ns"].to_pylist()
    assert again == rows


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["-o", "x.odd"], 2),
        (["-o", "x.csv"], 2),
        (["-o", "x.csv", "--topic", "/none"], 3),
        (["-o", "x.mat", "--from", "later"], 2),
        (["-o", "x.mat", "--from", "2", "--to", "1"], 2),
        (["-o", "x.mp4", "--topic", "/table/encoder"], 3),
        (["-o", "x.mat", "--weld", "7"], 2),
    ],
)
def test_what_cannot_be_exported_is_said(
    session_path: Path, words: list[str], code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(session_path.parent)
    assert run(["export", str(session_path), *words]) == code
    assert not list(session_path.parent.glob("x.*"))


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_compacted_session_holds_the_same(tmp_path: Path, scenario: str, capsys: Any) -> None:
    expected = SCENARIOS[scenario](tmp_path / "a.mcap")
    assert run(["compact", str(tmp_path / "a.mcap"), "-o", str(tmp_path / "b.mcap"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["lost"] == 0
    with seamlog.open_session(tmp_path / "b.mcap") as session:
        for topic, wanted in expected.items():
            assert_same(session.columns(topic), wanted)
            rows = [row for file in session.files for row in file.channels(topic)]
            sizes = [e.uncompressed_size for f in session.files for e in f.entries(rows[0].id)]
            assert all(size >= 1 << 20 for size in sizes[:-1])
        assert session.problems == []


def test_compacting_says_what_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    SCENARIOS["numeric_zstd"](path)
    data = bytearray(path.read_bytes())
    data[200_000] ^= 0xFF
    path.write_bytes(data)
    assert run(["compact", str(path), "-o", str(tmp_path / "b.mcap")]) == 1
    with seamlog.open_session(tmp_path / "b.mcap") as session:
        assert any("damaged" in problem for problem in session.problems)
