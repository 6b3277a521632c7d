"""Bags, TDMS, MATLAB 7.3, Parquet and video files, made by the libraries of others."""

import json
import struct
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import av
import cv2
import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from mcap.reader import make_reader
from nptdms import ChannelObject, TdmsWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from seamlog.cli import run
from seamlog.recorder.importers.mat import MatImporter
from seamlog.recorder.importers.parquet import ParquetImporter
from seamlog.recorder.importers.tdms import TdmsImporter
from seamlog.session import open_session

START_NS = 1_700_000_000_000_000_000
ENCODER_MAP = """[channels."/table/encoder".fields]
position_m = {{ column = "{}" }}
"""
OTHER_BYTES = [b"", b"\0" * 300, b"#ROSBAG V2.0\n" + b"\xff" * 90, b"TDSm" + b"\7" * 99]
ROWS = "".join(f"{k / 100},{k},{k},{k % 7}\n" for k in range(60))
CSV = f"t,act_pos [mm],cmd_pos [mm],spare\n{ROWS}"


def imported(path: Path, *more: str, code: int = 0) -> Path:
    output = path.parent / "session.mcap"
    assert run(["import", str(path), "-o", str(output), "--force", *more]) == code
    return output


def joint_state(store: Any, place: int, ros: int) -> Any:
    types = store.types
    time = types["builtin_interfaces/msg/Time"](sec=1_700_000_000 + place, nanosec=7)
    extra = {"seq": place} if ros == 1 else {}
    header = types["std_msgs/msg/Header"](**extra, stamp=time, frame_id="base")
    values = np.array([place, place / 2])
    return types["sensor_msgs/msg/JointState"](header, ["a", "b"], values, values * 2, values * 3)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    store = get_typestore(Stores.ROS2_HUMBLE)
    path = tmp_path / "bag"
    with Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        kind = "sensor_msgs/msg/JointState"
        connection = writer.add_connection("/joints", kind, typestore=store)
        for place in range(5):
            raw = store.serialize_cdr(joint_state(store, place, 2), kind)
            writer.write(connection, START_NS + place, raw)
    return path


def check_joints(session_path: Path) -> None:
    with open_session(session_path) as session:
        columns = session.columns("/joints")
        assert session.problems == []
    assert columns["name"][2] == ["a", "b"]
    np.testing.assert_array_equal(columns["velocity"][3], [6.0, 3.0])
    assert columns["stamp_ns"][4] == (1_700_000_004 * 10**9 + 7)
    assert columns["log_time_ns"].tolist() == [START_NS + place for place in range(5)]


def test_a_sqlite_bag_is_imported_whole(bag: Path) -> None:
    check_joints(imported(bag))
    check_joints(imported(next(bag.glob("*.db3"))))


def test_a_ros_1_bag_is_imported_whole(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    kind = "sensor_msgs/msg/JointState"
    with Writer1(tmp_path / "x.bag") as writer:
        connection = writer.add_connection("/joints", kind, typestore=store)
        for place in range(5):
            raw = store.serialize_ros1(joint_state(store, place, 1), kind)
            writer.write(connection, START_NS + place, raw)
    check_joints(imported(tmp_path / "x.bag"))


def test_a_map_takes_axes_out_of_a_bag(bag: Path) -> None:
    mapping = bag.parent / "map.toml"
    mapping.write_text(
        '[channels."/table/encoder".fields]\nposition_m = { column = "/joints.position[1]" }\n'
    )
    with open_session(imported(bag, "--map", str(mapping))) as session:
        encoder = session.columns("/table/encoder")
        assert "/joints" in session.info.channels
    assert encoder["position_m"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert encoder["stamp_ns"][1] == 1_700_000_001_000_000_007


def test_messages_without_definition_are_counted(tmp_path: Path, capsys: Any) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("float64 x\n", "odd_msgs/msg/Odd"))
    with Writer2(tmp_path / "bag", version=8) as writer:
        connection = writer.add_connection("/odd", "odd_msgs/msg/Odd", typestore=store)
        raw = store.serialize_cdr(store.types["odd_msgs/msg/Odd"](1.0), "odd_msgs/msg/Odd")
        writer.write(connection, START_NS, raw)
    import sqlite3

    database = sqlite3.connect(next((tmp_path / "bag").glob("*.db3")))
    database.execute("DELETE FROM message_definitions")
    database.commit()
    database.close()
    imported(tmp_path / "bag", "--json", code=1)
    notes = json.loads(capsys.readouterr().out)["losses"]
    assert notes == [
        "/odd: 1 messages were left out: the bag has no definition of odd_msgs/msg/Odd"
    ]


def test_a_missing_part_of_a_split_bag_is_named(bag: Path, capsys: Any) -> None:
    listing = bag / "metadata.yaml"
    name = next(bag.glob("*.db3")).name
    text = listing.read_text()
    listing.write_text(text.replace(f"- {name}\n", f"- {name}\n    - gone_1.db3\n", 1))
    check_joints(imported(bag, "--json", code=1))
    assert json.loads(capsys.readouterr().out)["losses"] == ["gone_1.db3 is missing"]


@pytest.mark.parametrize("suffix", ["bag", "db3", "mcap", "tdms", "mat", "parquet", "mp4"])
@pytest.mark.parametrize(
    "data", [b"", b"\0" * 300, b"#ROSBAG V2.0\n" + b"\xff" * 90, b"TDSm" + b"\7" * 99]
)
def test_bytes_of_another_kind_are_refused(tmp_path: Path, suffix: str, data: bytes) -> None:
    (tmp_path / f"x.{suffix}").write_bytes(data)
    code = run(
        ["import", str(tmp_path / f"x.{suffix}"), "-o", str(tmp_path / "s.mcap"), "--map", "m"]
    )
    assert code == 3
    assert not (tmp_path / "s.mcap").exists()


def test_a_matlab_file_of_which_its_reader_dies_is_an_error(tmp_path: Path, capsys: Any) -> None:
    path = tmp_path / "x.mat"
    scipy.io.savemat(path, {"s": {"b": np.arange(5.0)}})
    data = bytearray(path.read_bytes())
    data[data.index(struct.pack("<2I", 9, 40))] = 255  # a type of numbers that there is not
    path.write_bytes(data)
    assert run(["import", str(path), "-o", str(tmp_path / "s.mcap"), "--map", "m"]) == 3
    assert "x.mat is damaged" in capsys.readouterr().err
    assert not (tmp_path / "s.mcap").exists()


def test_waveforms_of_tdms_bring_time_and_unit(tmp_path: Path) -> None:
    start = np.datetime64("2024-01-02T03:04:05", "us")
    wave = {
        "wf_start_time": start,
        "wf_increment": 0.01,
        "wf_start_offset": 0.5,
        "unit_string": "mm",
    }
    with TdmsWriter(tmp_path / "x.tdms") as writer:
        writer.write_segment([
            ChannelObject("g", "pos", np.arange(4.0), properties=wave | {"unit_string": "mm"}),
            ChannelObject("g", "name", ["a", "b"]),
        ])  # fmt: skip
    content = TdmsImporter().load(tmp_path / "x.tdms")
    start_ns = round(datetime(2024, 1, 2, 3, 4, 5, tzinfo=UTC).timestamp()) * 10**9 + 500_000_000
    assert content.columns["g/pos time"].tolist() == [
        start_ns + place * 10_000_000 for place in range(4)
    ]
    assert content.units["g/pos"] == "mm"
    assert any("g/name" in note for note in content.notes)
    mapping = tmp_path / "map.toml"
    mapping.write_text(ENCODER_MAP.format("g/pos"))
    with open_session(imported(tmp_path / "x.tdms", "--map", str(mapping))) as session:
        encoder = session.columns("/table/encoder")
    np.testing.assert_allclose(encoder["position_m"], np.arange(4) / 1000)
    assert encoder["stamp_ns"][0] == start_ns


def test_a_waveform_without_start_says_so(tmp_path: Path) -> None:
    wave = {"wf_start_time": np.datetime64("1904-01-01", "us"), "wf_increment": 0.5}
    with TdmsWriter(tmp_path / "x.tdms") as writer:
        writer.write_segment([ChannelObject("g", "c", np.arange(3.0), properties=wave)])
    content = TdmsImporter().load(tmp_path / "x.tdms")
    assert content.columns["g/c time"].tolist() == [0, 500_000_000, 1_000_000_000]
    assert any("does not say when" in note for note in content.notes)


def test_pictures_without_times_are_said(tmp_path: Path, capsys: Any) -> None:
    pictures = b"".join(
        cv2.imencode(".jpg", np.full((48, 64, 3), level, np.uint8))[1].tobytes()
        for level in (0, 90)
    )
    (tmp_path / "x.mjpeg").write_bytes(pictures)
    imported(tmp_path / "x.mjpeg", "--json")
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert any("were assumed" in note for note in notes)


def test_matlab_73_is_read(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = np.arange(4.0)[None, :]
        group = file.create_group("axis")
        group["q"] = np.arange(8.0).reshape(2, 4)
        for item in (file["t"], group["q"]):
            item.attrs["MATLAB_class"] = np.bytes_("double")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    columns = MatImporter().load(path).columns
    assert columns["t"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert columns["axis.q[1]"].tolist() == [4.0, 5.0, 6.0, 7.0]


def test_odd_parquet_types_are_read(tmp_path: Path) -> None:
    arrays = pa.FixedSizeListArray.from_arrays(pa.array([1.0, 2.0, 3.0, 4.0]), 2)
    spans = pa.array([1_000, 2_000], pa.duration("us"))
    coded = pa.array([5, 6]).dictionary_encode()
    table = pa.table({"a": arrays, "d": spans, "c": coded, "s": pa.array([{"x": 1}, {"x": 2}])})
    pq.write_table(table, tmp_path / "x.parquet")
    columns = ParquetImporter().load(tmp_path / "x.parquet").columns
    assert {name: column.tolist() for name, column in columns.items()} == {
        "a[0]": [1.0, 3.0],
        "a[1]": [2.0, 4.0],
        "d": [1_000_000, 2_000_000],
        "c": [5, 6],
        "s.x": [1, 2],
    }


def test_parquet_columns_are_read(tmp_path: Path) -> None:
    moments = pa.array([1_000, 2_000], pa.timestamp("us", tz="UTC"))
    unit = pa.field("x", pa.float32(), metadata={"unit": "mm"})
    schema = pa.schema([pa.field("t", moments.type), unit, pa.field("s", pa.string())])
    table = pa.table(
        [moments, pa.array([1.5, None], pa.float32()), pa.array(["a", "b"])], schema=schema
    )
    pq.write_table(table, tmp_path / "x.parquet")
    content = ParquetImporter().load(tmp_path / "x.parquet")
    assert content.columns["t"].tolist() == [1_000_000, 2_000_000]
    np.testing.assert_array_equal(content.columns["x"], [1.5, np.nan])
    assert content.units == {"t": "ns", "x": "mm"}
    assert any("'s'" in note for note in content.notes)


def test_dates_times_and_names_that_come_twice_in_parquet(tmp_path: Path) -> None:
    arrays = [
        pa.array([19_786, 19_787], pa.date32()),
        pa.array([1_500, 2_500], pa.time32("ms")),
        pa.array([1, 2]),
        pa.array([3, 4]),
        pa.array([1_000, None], pa.timestamp("us")),
    ]
    table = pa.table(arrays, names=["day", "clock", "x", "x", "holes"])
    pq.write_table(table, tmp_path / "x.parquet")
    content = ParquetImporter().load(tmp_path / "x.parquet")
    assert {name: column.tolist() for name, column in content.columns.items()} == {
        "day": [19_786 * 86_400 * 10**9, 19_787 * 86_400 * 10**9],
        "clock": [1_500_000_000, 2_500_000_000],
        "x": [1, 2],
        "x.2": [3, 4],
    }
    assert "column 'holes' holds times, but none in row 2" in content.notes


@pytest.mark.parametrize(("codec", "suffix"), [("mpeg4", "mp4"), ("mjpeg", "mkv")])
def test_frames_keep_the_time_stamps_of_the_video(tmp_path: Path, codec: str, suffix: str) -> None:
    times_ms = [0, 40, 90, 200]
    with av.open(str(tmp_path / f"x.{suffix}"), "w") as container:
        container.metadata["creation_time"] = "2024-01-02T03:04:05Z"
        stream: Any = container.add_stream(codec, rate=1000)
        stream.width, stream.height = 64, 48
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        for level, time in enumerate(times_ms):
            image = np.full((48, 64, 3), 40 * level, np.uint8)
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts = time
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    with open_session(imported(tmp_path / f"x.{suffix}")) as session:
        frames = session.frames()
        steps = (frames.stamps_ns - frames.stamps_ns[0]) / 1e6
        levels = [float(frame.image().mean()) for frame in frames]
    np.testing.assert_allclose(steps, times_ms, atol=1)
    np.testing.assert_allclose(levels, [0, 40, 80, 120], atol=6)
    start_ns = round(datetime(2024, 1, 2, 3, 4, 5, tzinfo=UTC).timestamp()) * 10**9
    assert abs(int(frames.stamps_ns[0]) - start_ns) < 2_000_000


CSV = "t,act_pos [mm],cmd_pos [mm],spare\n" + "".join(
    f"{k / 100},{k},{k},{k % 7}\n" for k in range(60)
)


def test_a_guessed_map_imports_and_says_what_was_guessed(tmp_path: Path) -> None:
    log, mapping = tmp_path / "x.csv", tmp_path / "map.toml"
    log.write_text(CSV)
    assert run(["import", str(log), "--guess", "-o", str(mapping)]) == 0
    text = mapping.read_text()
    tree = tomllib.loads(text)
    assert tree["channels"]["/table/encoder"]["fields"]["position_m"]["column"] == "act_pos [mm]"
    assert tree["channels"]["/table/reference"]["fields"]["position_m"]["unit"] == "mm"
    assert "guessed" in text
    with open_session(imported(log, "--map", str(mapping))) as session:
        assert session.columns("/table/encoder")["position_m"][10] == pytest.approx(0.01)
        assert session.columns("/import/x")["spare"].tolist()[:8] == [0, 1, 2, 3, 4, 5, 6, 0]


def test_without_a_time_the_guess_must_be_completed(tmp_path: Path) -> None:
    log, mapping = tmp_path / "x.csv", tmp_path / "map.toml"
    log.write_text("a,b\n3,1\n1,2\n2,5\n")
    assert run(["import", str(log), "--guess", "-o", str(mapping)]) == 0
    assert run(["import", str(log), "--map", str(mapping), "-o", str(tmp_path / "s.mcap")]) == 2
    mapping.write_text(mapping.read_text().replace("rate_hz = 0", "rate_hz = 10"))
    with open_session(imported(log, "--map", str(mapping))) as session:
        assert session.columns("/import/x")["stamp_ns"].tolist() == [0, 100_000_000, 200_000_000]


def test_a_table_without_a_map_says_how_to_get_one(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "x.csv").write_text(CSV)
    assert run(["import", str(tmp_path / "x.csv"), "--dry-run"]) == 2
    assert "--guess" in capsys.readouterr().err


MAPS = {
    "servo_cnc_mill/experiment_01.csv": "cnc_axis",
    "servo_cnc_mill/experiment_04.csv": "cnc_axis",
    "weld_log/20180309_14_44_27_welder_data.csv": "welder_log",
    "emps/DATA_EMPS.mat": "emps",
}
FILES = [
    "emps/DATA_EMPS.mat", "servo_cnc_mill/experiment_01.csv", "servo_cnc_mill/experiment_04.csv",
    "tdms/Digital_Input.tdms", "tdms/raw_timestamps.tdms",
    "weld_log/20180309_14_44_27_welder_data.csv",
]  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_real_files_import_by_their_guessed_maps(data_dir: Path, tmp_path: Path, name: str) -> None:
    mapping, output = tmp_path / "map.toml", tmp_path / "s.mcap"
    assert run(["import", str(data_dir / name), "--guess", "-o", str(mapping)]) == 0
    mapping.write_text(mapping.read_text().replace("rate_hz = 0", "rate_hz = 10"))
    assert run(["import", str(data_dir / name), "--map", str(mapping), "-o", str(output)]) == 0
    with open_session(output) as session:
        assert session.info.message_count > 100
        assert session.problems == []


@pytest.mark.parametrize("name", ["cdr_test", "talker", "wbag"])
def test_real_bags_are_imported_whole(data_dir: Path, tmp_path: Path, name: str) -> None:
    output = tmp_path / "s.mcap"
    assert run(["import", str(data_dir / "mcap" / name), "-o", str(output)]) == 0
    with open_session(data_dir / "mcap" / name) as bag, open_session(output) as session:
        assert {c.topic: c.count for c in bag.info.channels.values()} == {
            c.topic: c.count for c in session.info.channels.values()
        }


@pytest.mark.parametrize("name", MAPS)
def test_real_files_import_by_the_maps_of_the_examples(data_dir: Path, name: str) -> None:
    mapping = Path(__file__).parents[2] / "examples" / f"{MAPS[name]}.map.toml"
    assert run(["import", str(data_dir / name), "--map", str(mapping), "--dry-run"]) == 0


def test_readers_of_others_open_an_imported_session(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text(CSV)
    assert run(["import", str(tmp_path / "x.csv"), "--guess", "-o", str(tmp_path / "m.toml")]) == 0
    path = imported(tmp_path / "x.csv", "--map", str(tmp_path / "m.toml"))
    assert run(["compact", str(path), "-o", str(tmp_path / "c.mcap")]) == 0
    for session in (path, tmp_path / "c.mcap"):
        with session.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            count = sum(1 for _ in reader.iter_messages(["/import/x"]))
        with AnyReader([session]) as bag:
            rows = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages()]
        spare = [row.spare for row in rows if hasattr(row, "spare")]
        assert count == len(spare) == 60
        assert spare[:8] == [0, 1, 2, 3, 4, 5, 6, 0]
