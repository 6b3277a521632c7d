"""Every kind of value through every format, against what was written, not against our reader."""

import csv
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy.io
from mcap.writer import Writer

from seamlog import messages
from seamlog.channels import CHANNELS
from seamlog.cli import run
from seamlog.export import parts
from seamlog.messages import CdrWriter
from tests.core.scenarios import START_NS

KINDS = {
    "flag": "bool", "mode": "uint8", "small": "int8", "steps": "int64", "serial": "uint64",
    "current_a": "float32", "position_m": "float64", "note": "string", "pair": "float64[2]",
    "path_m": "float64[]", "ticks": "int64[]", "names": "string[]",
}  # fmt: skip
NAN, INF = float("nan"), float("inf")
ROWS: list[dict[str, Any]] = [
    {
        "flag": True, "mode": 3, "small": -128, "steps": -(2**63), "serial": 2**64 - 1,
        "current_a": 0.5, "position_m": 0.1 + 0.2, "note": 'a, "b"\nc;', "pair": [1.0, NAN],
        "path_m": [], "ticks": [2**53 + 1], "names": [],
    },
    {
        "flag": False, "mode": 255, "small": 127, "steps": 2**53 + 1, "serial": 0,
        "current_a": NAN, "position_m": NAN, "note": "", "pair": [-0.0, 5e-324],
        "path_m": [1e308, NAN, -INF], "ticks": [], "names": ["näht", ""],
    },
    {
        "flag": True, "mode": 0, "small": 0, "steps": 2**63 - 1, "serial": 2**53 + 1,
        "current_a": -INF, "position_m": INF, "note": "Naht 7 °C 🔧", "pair": [2.0, 3.0],
        "path_m": [0.25], "ticks": [-(2**63), 2**63 - 1], "names": ["a,b", "c"],
    },
]  # fmt: skip
STAMPS = [START_NS + 123_456_789, START_NS + 123_456_790, START_NS + 5_000_000_001]
LOG_TIMES = [stamp + 1001 for stamp in STAMPS]
PICTURES = [
    (kind, bytes(cv2.imencode(f".{kind}", np.full((16, 24, 3), level, np.uint8))[1]))
    for kind, level in (("jpeg", 10), ("png", 90), ("jpeg", 200))
]


@pytest.fixture
def session_path(tmp_path: Path) -> Path:
    path = tmp_path / "all.mcap"
    definition = "".join(f"{kind} {name}\n" for name, kind in KINDS.items())
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=100)
        writer.start(profile="ros2")
        text = f"int64 stamp_ns\n{definition}".encode()
        everything = writer.register_schema("test/msg/Everything", "ros2msg", text)
        channel = writer.register_channel("/cell 1/all", "cdr", everything)
        image = CHANNELS["/camera/image"]
        schema = writer.register_schema(
            image.schema, "ros2msg", messages.definition(image).encode()
        )
        camera = writer.register_channel("/camera/image", "cdr", schema)
        for row, stamp, time, picture in zip(ROWS, STAMPS, LOG_TIMES, PICTURES, strict=True):
            message = CdrWriter()
            message.put("int64", stamp)
            for name, kind in KINDS.items():
                message.put(kind, row[name])
            writer.add_message(channel, time, message.payload(), time)
            writer.add_message(camera, time, messages.encode_image(stamp, "c", *picture), time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.fixture(params=[1 << 26, 1], ids=["at once", "in parts"])
def in_parts(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "_PART_BYTES", request.param)


def export(session_path: Path, name: str, *words: str) -> Path:
    output = session_path.parent / name
    assert run(["export", str(session_path), "-o", str(output), *words]) == 0
    return output


def assert_rows(name: str, found: list[Any], wanted: list[Any] | None = None) -> None:
    for value, right in zip(found, wanted or [row[name] for row in ROWS], strict=True):
        if isinstance(right, str) or KINDS.get(name) == "string[]":
            assert value == right
        else:
            kind = np.float32 if name == "current_a" else None
            left, other = np.asarray(value), np.asarray(right, kind)
            np.testing.assert_array_equal(left, other, name)
            if other.dtype.kind == "f" and left.dtype.kind == "f":
                np.testing.assert_array_equal(np.signbit(left), np.signbit(other), name)


@pytest.mark.usefixtures("in_parts")
def test_parquet(session_path: Path) -> None:
    table = pq.read_table(export(session_path, "a.parquet", "--topic", "/cell 1/all"))
    assert_rows("log_time_ns", table["log_time_ns"].to_pylist(), LOG_TIMES)
    assert_rows("stamp_ns", table["stamp_ns"].to_pylist(), STAMPS)
    for name in KINDS:
        assert_rows(name, table[name].to_pylist())
    types = {name: str(table.schema.field(name).type) for name in KINDS}
    assert (types["flag"], types["mode"], types["serial"]) == ("bool", "uint8", "uint64")
    assert (types["current_a"], types["note"]) == ("float", "string")
    images = pq.read_table(export(session_path, "i.parquet", "--topic", "/camera/image"))
    assert [bytes(data) for data in images["data"].to_pylist()] == [p for _, p in PICTURES]


@pytest.mark.usefixtures("in_parts")
def test_csv(session_path: Path) -> None:
    with export(session_path, "a.csv", "--topic", "/cell 1/all").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert_rows("log_time_ns", [int(row["log_time_ns"]) for row in rows], LOG_TIMES)
    assert_rows("stamp_ns", [int(row["stamp_ns"]) for row in rows], STAMPS)
    for name in ("flag", "mode", "small", "steps", "serial"):
        assert_rows(name, [int(row[name]) for row in rows])
    assert_rows("current_a", [np.float32(row["current_a"]) for row in rows])
    assert_rows("position_m", [float(row["position_m"]) for row in rows])
    assert_rows("note", [row["note"] for row in rows])
    assert_rows("pair", [[float(row["pair[0]"]), float(row["pair[1]"])] for row in rows])
    for name in ("path_m", "ticks", "names"):
        assert_rows(name, [json.loads(row[name]) for row in rows])


def test_mat(session_path: Path) -> None:
    path = export(session_path, "a.mat", "--topic", "/cell 1/all", "--topic", "/camera/image")
    found = scipy.io.loadmat(path)
    record = found["cell_1_all"][0, 0]
    assert_rows("stamp_ns", record["stamp_ns"].ravel().tolist(), STAMPS)
    assert_rows("log_time_ns", record["log_time_ns"].ravel().tolist(), LOG_TIMES)
    for name in ("flag", "mode", "small", "steps", "serial", "current_a", "position_m"):
        assert_rows(name, list(record[name].ravel()))
    assert_rows("pair", list(record["pair"]))
    for name in ("path_m", "ticks"):
        assert_rows(name, [cell.ravel() for cell in record[name].ravel()])
    texts = [str(cell.item()) if cell.size else "" for cell in record["note"].ravel()]
    assert_rows("note", texts)
    names = [
        [str(item.item()) if item.size else "" for item in cell.ravel()]
        for cell in record["names"].ravel()
    ]
    assert_rows("names", names)
    data = [bytes(cell.ravel()) for cell in found["camera_image"][0, 0]["data"].ravel()]
    assert data == [picture for _, picture in PICTURES]


def test_a_range_of_every_format_holds_the_same_messages(session_path: Path) -> None:
    words = ("--topic", "/cell 1/all", "--from", "0.000000001", "--to", "4.876543213")
    table = pq.read_table(export(session_path, "r.parquet", *words))
    assert table["stamp_ns"].to_pylist() == STAMPS[1:]
    with export(session_path, "r.csv", *words[:4], "--to", "4.876543212").open() as file:
        assert [int(row["stamp_ns"]) for row in csv.DictReader(file)] == STAMPS[1:2]
    record = scipy.io.loadmat(export(session_path, "r.mat", *words))["cell_1_all"][0, 0]
    assert record["steps"].ravel().tolist() == [row["steps"] for row in ROWS[1:]]
    rrd = read_rerun(export(session_path, "r.rrd", *words))
    assert rrd["/cell 1/all/note"]["stamp"] == STAMPS[1:]


def read_rerun(path: Path) -> dict[str, dict[str, list[Any]]]:
    """Entity to column to values, by Rerun's own reader; times in ns since 1970."""
    from rerun.chunk import RrdReader

    found: dict[str, dict[str, list[Any]]] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        entity = found.setdefault(chunk.entity_path.replace("\\", ""), {})
        for name in batch.schema.names:
            column = batch.column(name)
            times = name in ("stamp", "log_time")
            rows = column.cast("int64") if times else column
            entity.setdefault(name, []).extend(rows.to_pylist())
    return found


@pytest.mark.usefixtures("in_parts")
def test_rerun(session_path: Path) -> None:
    pytest.importorskip("rerun")
    found = read_rerun(export(session_path, "a.rrd"))
    numbers = {name: f"/cell 1/all/{name}" for name in KINDS}
    for name, entity in numbers.items():
        if name == "pair":
            continue
        assert found[entity]["stamp"] == STAMPS
        assert found[entity]["log_time"] == LOG_TIMES
    for name in ("flag", "mode", "small", "current_a", "position_m"):
        assert_rows(name, [row[0] for row in found[numbers[name]]["Scalars:scalars"]])
    pairs = [found[f"/cell 1/all/pair[{place}]"]["Scalars:scalars"] for place in (0, 1)]
    assert_rows("pair", [[*one, *two] for one, two in zip(*pairs, strict=True)])
    assert_rows("path_m", found[numbers["path_m"]]["Scalars:scalars"])
    assert_rows("steps", [row[0] for row in found[numbers["steps"]]["int64"]])
    assert_rows("serial", [row[0] for row in found[numbers["serial"]]["uint64"]])
    assert_rows("ticks", found[numbers["ticks"]]["int64"])
    assert_rows("note", [row[0] for row in found[numbers["note"]]["TextLog:text"]])
    texts = [json.loads(row[0]) for row in found[numbers["names"]]["TextLog:text"]]
    assert_rows("names", texts)
    images = found["/camera/image"]
    assert images["stamp"] == STAMPS and images["log_time"] == LOG_TIMES
    assert [bytes(row[0]) for row in images["EncodedImage:blob"]] == [p for _, p in PICTURES]
    kinds = [row[0] for row in images["EncodedImage:media_type"]]
    assert kinds == ["image/jpeg", "image/png", "image/jpeg"]


def test_json_of_mixed_values(tmp_path: Path) -> None:
    path = tmp_path / "j.mcap"
    rows = [{"a": 1, "b": [1, "x"]}, {"a": 1.5, "b": ["y"]}, {"a": None, "c": {"d": 2**60}}]
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=10)
        writer.start()
        channel = writer.register_channel("/j", "json", 0)
        for time, row in enumerate(rows):
            writer.add_message(channel, time, json.dumps(row).encode(), time)
        writer.finish()  # type: ignore[no-untyped-call]
    table = pq.read_table(export(path, "j.parquet", "--topic", "/j"))
    assert_rows("a", table["a"].to_pylist(), [1, 1.5, NAN])
    assert table["b"].to_pylist() == ['[1, "x"]', '["y"]', ""]
    with export(path, "j.csv", "--topic", "/j").open() as file:
        assert [row["b"] for row in csv.DictReader(file)] == table["b"].to_pylist()
