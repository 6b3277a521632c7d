"""Sessions with known content, read by every reader test.

A scenario writes a file to the path it is given and returns what must come out of it: topic to
column name to values.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer

from seamlog import messages
from seamlog.channels import ARC_OFF, ARC_ON, CHANNELS, NOTE
from seamlog.mcap.batch import BatchWriter
from seamlog.mcap.packing import payload_records
from seamlog.mcap.writer import FileWriter

Expected = dict[str, dict[str, Any]]
Make = Callable[[Path], Expected]
SCENARIOS: dict[str, Make] = {}
START_NS = 1_767_225_600_000_000_000
JOINTS = """std_msgs/Header header
string[] name
float64[] position
geometry_msgs/Point[] tips
geometry_msgs/Point base
bool ok
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
"""


def scenario(make: Make) -> Make:
    """Register a scenario under the name of its function."""
    SCENARIOS[make.__name__] = make
    return make


def times(count: int, period_ns: int = 40_000_000) -> np.ndarray[Any, np.dtype[np.int64]]:
    return START_NS + np.arange(count, dtype=np.int64) * period_ns


def encoder_columns(count: int) -> dict[str, Any]:
    noise = np.random.default_rng(1).normal(size=(2, count))
    return {"stamp_ns": times(count), "position_m": noise[0], "velocity_m_s": noise[1]}


def write_numeric(path: Path, compression: str, count: int = 40_000) -> Expected:
    encoder = encoder_columns(count)
    command = {"stamp_ns": times(9), "command": np.arange(9.0), "saturated": np.arange(9) % 2 == 0}
    state = {"stamp_ns": times(5), "values": np.arange(40.0).reshape(5, 8)}
    with BatchWriter(path, compression=compression) as writer:
        writer.write("/table/encoder", encoder, encoder["stamp_ns"] + 7)
        writer.write("/table/command", command, metadata={"unit": "N"})
        writer.write_as("/replay/pd/state", CHANNELS["/controller/state"], state)
    log = {"log_time_ns": encoder["stamp_ns"] + 7}
    return {
        "/table/encoder": encoder | log,
        "/table/command": command | {"log_time_ns": command["stamp_ns"]},
        "/replay/pd/state": state | {"log_time_ns": state["stamp_ns"]},
    }


@scenario
def numeric_zstd(path: Path) -> Expected:
    return write_numeric(path, "zstd")


@scenario
def numeric_lz4(path: Path) -> Expected:
    return write_numeric(path, "lz4")


@scenario
def numeric_uncompressed(path: Path) -> Expected:
    return write_numeric(path, "")


@scenario
def events_and_paths(path: Path) -> Expected:
    """Messages of varying length, log times out of order."""
    events, seam = CHANNELS["/events"], CHANNELS["/seam/path"]
    kinds, details = [ARC_ON, ARC_OFF, NOTE], ["", "Lichtbogen aus – äöü", "a note"]
    stamps = times(3).tolist()
    written = [messages.encode(events, row) for row in zip(stamps, kinds, details, strict=True)]
    lines = [np.arange(count, dtype=float) for count in (0, 1, 5, 5, 300)]
    paths = [messages.encode(seam, (int(t), x, -x)) for t, x in zip(times(5), lines, strict=True)]
    with BatchWriter(path) as writer:
        writer.write_payloads("/events", events, written, [stamps[0], stamps[2], stamps[1]])
        writer.write_payloads("/seam/path", seam, paths, times(5))
    return {
        "/events": {
            "log_time_ns": times(3),
            "stamp_ns": [stamps[0], stamps[2], stamps[1]],
            "kind": [kinds[0], kinds[2], kinds[1]],
            "detail": [details[0], details[2], details[1]],
        },
        "/seam/path": {"stamp_ns": times(5), "x_m": lines, "y_m": [-line for line in lines]},
    }


def picture(place: int) -> bytes:
    return b"\xff\xd8\xff" + bytes([place]) * (50 + 37 * place)


def write_live(path: Path, chunks: int = 6) -> Expected:
    """Small chunks that stand alone, as the recorder writes them, with pictures between."""
    encoder, camera = CHANNELS["/table/encoder"], CHANNELS["/camera/image"]
    with path.open("xb", buffering=0) as file:
        writer = FileWriter(file, "seamlog test")
        ids = []
        for row in (encoder, camera):
            schema = writer.add_schema(row.schema, messages.definition(row))
            ids.append(writer.add_channel(row.topic, schema, {"producer": "1"}))
        columns = encoder_columns(3 * chunks)
        rows = list(zip(*(columns[name].tolist() for name in encoder.field_names), strict=True))
        for chunk in range(chunks):
            part = slice(3 * chunk, 3 * chunk + 3)
            payloads = [messages.encode(encoder, row) for row in rows]
            log = columns["stamp_ns"]
            data, offsets = payload_records(payloads, log, part, ids[0], 0)
            writer.write_chunk(ids[0], data, log[part].view(np.uint64), offsets)
            stamp = times(chunks)[chunk : chunk + 1]
            frame = messages.encode_image(int(stamp[0]) - 5, "camera", "jpeg", picture(chunk))
            data, offsets = payload_records([frame], stamp, slice(0, 1), ids[1], chunk)
            writer.write_chunk(ids[1], data, stamp.view(np.uint64), offsets, "")
        writer.add_attachment("photo/a.jpg", picture(3), "image/jpeg", START_NS)
        writer.add_metadata("seamlog.recording", {"id": "test", "index": "1"})
        writer.finish()
    return {
        "/table/encoder": columns | {"log_time_ns": columns["stamp_ns"]},
        "/camera/image": {
            "log_time_ns": times(chunks),
            "stamp_ns": times(chunks) - 5,
            "header.frame_id": ["camera"] * chunks,
            "format": ["jpeg"] * chunks,
            "data": [np.frombuffer(picture(place), np.uint8) for place in range(chunks)],
        },
    }


@scenario
def live(path: Path) -> Expected:
    return write_live(path)


def joints_payload(stamp_ns: int, names: list[str], positions: list[float]) -> bytes:
    writer = messages.CdrWriter()
    writer.put("int32", stamp_ns // 1_000_000_000)
    writer.put("uint32", stamp_ns % 1_000_000_000)
    writer.put("string", "base")
    writer.put("string[]", names)
    writer.put("float64[]", positions)
    writer.put("uint32", len(positions))
    for position in positions:
        writer.put("float64", position)
        writer.put("float64", 2 * position)
    writer.put("float64", 1.5)
    writer.put("float64", -1.5)
    writer.put("bool", True)
    return writer.payload()


def write_foreign(path: Path, options: Mapping[str, Any], count: int = 60) -> Expected:
    """Three interleaved topics as the mcap package writes them."""
    stamps, sizes = times(count).tolist(), [place % 4 for place in range(count)]
    encoder = encoder_columns(count)
    with path.open("xb") as file:
        writer = Writer(file, **{"chunk_size": 2000, "use_chunking": True, **options})
        writer.start("ros2", "test")
        text = messages.definition(CHANNELS["/table/encoder"])
        first = writer.register_schema("seamlog_msgs/msg/Encoder", "ros2msg", text.encode())
        second = writer.register_schema("my_msgs/msg/Joints", "ros2msg", JOINTS.encode())
        third = writer.register_schema("status", "jsonschema", b"{}")
        topics = (("/table/encoder", "cdr"), ("/joints", "cdr"), ("/status", "json"))
        ids = [
            writer.register_channel(topic, encoding, schema)
            for (topic, encoding), schema in zip(topics, (first, second, third), strict=True)
        ]
        for place, (stamp, size) in enumerate(zip(stamps, sizes, strict=True)):
            row = [encoder[name][place].item() for name in encoder]
            document = {"level": place, "inner": {"text": str(place)}}
            payloads = (
                messages.encode(CHANNELS["/table/encoder"], row),
                joints_payload(stamp, ["a", "bb", "ccc", "x"][:size], [place + 0.5] * size),
                json.dumps(document).encode(),
            )
            for number, payload in zip(ids, payloads, strict=True):
                writer.add_message(number, stamp + 3, payload, stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return {
        "/table/encoder": encoder | {"log_time_ns": encoder["stamp_ns"] + 3},
        "/joints": {
            "log_time_ns": times(count) + 3,
            "stamp_ns": times(count),
            "header.frame_id": ["base"] * count,
            "name": [["a", "bb", "ccc", "x"][:size] for size in sizes],
            "position": [np.full(size, place + 0.5) for place, size in enumerate(sizes)],
            "tips.x": [np.full(size, place + 0.5) for place, size in enumerate(sizes)],
            "tips.y": [np.full(size, 2 * place + 1.0) for place, size in enumerate(sizes)],
            "base.y": [-1.5] * count,
            "ok": [True] * count,
        },
        "/status": {"level": range(count), "inner.text": [str(place) for place in range(count)]},
    }


@scenario
def foreign(path: Path) -> Expected:
    return write_foreign(path, {})


@scenario
def foreign_large_chunks(path: Path) -> Expected:
    """Chunks that are read through their message indexes."""
    return write_foreign(path, {"chunk_size": 600_000}, 3000)


@scenario
def foreign_lz4(path: Path) -> Expected:
    return write_foreign(path, {"compression": CompressionType.LZ4})


@scenario
def foreign_without_message_index(path: Path) -> Expected:
    return write_foreign(path, {"index_types": IndexType.CHUNK})


@scenario
def foreign_without_index(path: Path) -> Expected:
    return write_foreign(path, {"index_types": IndexType.NONE})


@scenario
def foreign_without_chunks(path: Path) -> Expected:
    return write_foreign(path, {"use_chunking": False})


@scenario
def foreign_without_summary(path: Path) -> Expected:
    bare = {"use_statistics": False, "use_summary_offsets": False, "repeat_channels": False}
    return write_foreign(path, bare | {"repeat_schemas": False, "index_types": IndexType.NONE})


def assert_same(found: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
    """Each expected column is there with exactly these values."""
    for name, values in expected.items():
        column = found[name]
        assert len(column) == len(values), name
        if column.dtype.kind == "O":
            for one, other in zip(column, values, strict=True):
                assert_value(one, other)
        else:
            np.testing.assert_array_equal(column, np.asarray(values), err_msg=name)


def assert_value(one: Any, other: Any) -> None:
    if isinstance(other, np.ndarray):
        np.testing.assert_array_equal(one, other)
    else:
        assert one == other
