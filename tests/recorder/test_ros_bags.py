"""ROS bags as killed recorders, other tools and half a copy leave them."""

import json
import shutil
import sqlite3
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter

import seamlog
from seamlog.cli import run

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")
STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
START_NS = 1_700_000_000_000_000_000
COUNT = 10


def joint_state(place: int) -> Any:
    types = STORE.types
    stamp = types["builtin_interfaces/msg/Time"](1_700_000_000 + place, 5)
    header = types["std_msgs/msg/Header"](stamp, "base")
    values = np.array([place, -place], float)
    return types["sensor_msgs/msg/JointState"](header, ["a", "b"], values, values, np.empty(0))


def write_bag(path: Path, plugin: str, by_message: bool = False) -> Path:
    name = "sensor_msgs/msg/JointState"
    writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[plugin])
    if by_message:
        mode, form = rosbag2.CompressionMode.MESSAGE, rosbag2.CompressionFormat.ZSTD
        writer.set_compression(mode, form)
    with writer:
        connection = writer.add_connection("/joints", name, typestore=STORE)
        for place in range(COUNT):
            raw = STORE.serialize_cdr(joint_state(place), name)
            writer.write(connection, START_NS + place, raw)
    return path


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return tmp_path / "s.mcap"


def imported(bag: Path, session: Path, capsys: Any) -> tuple[int, dict[str, Any]]:
    code = run(["import", str(bag), "-o", str(session), "--json"])
    return code, json.loads(capsys.readouterr().out)


def positions(session: Path) -> list[float]:
    with seamlog.open_session(session) as opened:
        found: list[float] = opened.columns("/joints", ["position[1]"])["position[1]"].tolist()
    return found


@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
def test_messages_packed_one_by_one(
    tmp_path: Path, session: Path, plugin: str, capsys: Any
) -> None:
    code, told = imported(write_bag(tmp_path / "b", plugin, True), session, capsys)
    assert (code, told["losses"]) == (0, [])
    assert positions(session) == [-place for place in range(COUNT)]


def test_the_journal_of_a_killed_recorder_is_read(
    tmp_path: Path, session: Path, capsys: Any
) -> None:
    bag = write_bag(tmp_path / "b", "SQLITE3")
    database = next(bag.glob("*.db3"))
    connection = sqlite3.connect(database)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA wal_autocheckpoint = 0")
    connection.execute(
        "INSERT INTO messages (topic_id, timestamp, data) "
        "SELECT topic_id, timestamp + 1000, data FROM messages"
    )
    connection.commit()
    killed = Path(shutil.copytree(bag, tmp_path / "killed"))
    connection.close()
    code, told = imported(killed, session, capsys)
    assert (code, told["messages"]) == (0, 2 * COUNT)
    assert any("-wal holds the last messages" in note for note in told["notes"])
    assert {path.name for path in killed.iterdir()} >= {f"{database.name}-wal"}


def test_fewer_messages_than_the_metadata_count_are_a_loss(
    tmp_path: Path, session: Path, capsys: Any
) -> None:
    bag = write_bag(tmp_path / "b", "SQLITE3")
    connection = sqlite3.connect(next(bag.glob("*.db3")))
    connection.execute("DELETE FROM messages WHERE id > 7")
    connection.commit()
    connection.close()
    code, told = imported(bag, session, capsys)
    assert code == 1
    assert told["losses"] == ["b.db3: metadata.yaml counts 10 messages, 3 more than were found"]


@pytest.mark.parametrize("text", ["{{{", ""])
def test_metadata_that_cannot_be_read_are_no_reason_to_refuse(
    tmp_path: Path, session: Path, text: str, capsys: Any
) -> None:
    bag = write_bag(tmp_path / "b", "MCAP")
    (bag / "metadata.yaml").write_text(text)
    code, told = imported(bag, session, capsys)
    assert (code, told["messages"]) == (0, COUNT)
    assert "nothing tells whether parts are missing" in told["notes"][0]


def test_a_cut_database_is_refused_with_advice(tmp_path: Path, session: Path, capsys: Any) -> None:
    bag = write_bag(tmp_path / "b", "SQLITE3")
    database = next(bag.glob("*.db3"))
    database.write_bytes(database.read_bytes()[: database.stat().st_size // 2])
    code, told = imported(bag, session, capsys)
    assert code == 3 and ".recover" in told["message"]
    assert not session.exists()


HEAD = bytes([0, 1, 0, 0])
POINT = HEAD + struct.pack("<di", 1.5, 7)
POINT_TEXT = "float64 x\nint32 n\n"


def write_mcap(path: Path, schema: tuple[str, str, str] | None, encoding: str, data: bytes) -> Path:
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2")
        number = 0
        if schema:
            number = writer.register_schema(schema[0], schema[1], schema[2].encode())
        channel = writer.register_channel("/p", encoding, number)
        good = writer.register_schema("t/msg/P", "ros2msg", POINT_TEXT.encode())
        other = writer.register_channel("/good", "cdr", good)
        for time in range(5):
            writer.add_message(channel, time, data, time)
            writer.add_message(other, time, POINT, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


STRANGE = {
    "no definition": (None, "cdr", POINT, "no message definition"),
    "part missing": (("t/msg/N", "ros2msg", "t/Other o\n"), "cdr", POINT, "no definition of t/Oth"),
    "wide strings": (("t/msg/W", "ros2msg", "wstring w\n"), "cdr", POINT, "different widths"),
    "other CDR": (("t/msg/P", "ros2msg", POINT_TEXT), "cdr", b"\0\7" + POINT[2:], "0007 is none"),
    "too short": (("t/msg/P", "ros2msg", POINT_TEXT), "cdr", POINT[:9], "needs 8 bytes"),
    "other encoding": (("t.P", "flatbuffer", "x"), "flatbuffer", b"x", "no decoder"),
}


@pytest.mark.parametrize("name", STRANGE)
def test_messages_that_cannot_be_read_are_copied_and_said(
    tmp_path: Path, session: Path, name: str, capsys: Any
) -> None:
    schema, encoding, data, said = STRANGE[name]
    code, told = imported(write_mcap(tmp_path / "x.mcap", schema, encoding, data), session, capsys)
    assert (code, told["messages"], len(told["losses"])) == (1, 10, 1)
    assert told["losses"][0].startswith("/p: its 5 messages were copied but cannot be read")
    assert said in told["losses"][0]
    with seamlog.open_session(session) as opened:
        assert opened.columns("/good")["n"].tolist() == [7] * 5


@pytest.mark.parametrize("name", STRANGE)
def test_a_map_takes_axes_out_of_a_bag_with_topics_that_cannot_be_read(
    tmp_path: Path, session: Path, name: str, capsys: Any
) -> None:
    schema, encoding, data, _ = STRANGE[name]
    bag, mapping = write_mcap(tmp_path / "x.mcap", schema, encoding, data), tmp_path / "m.toml"
    assert run(["import", str(bag), "--guess", "-o", str(mapping)]) == 0
    assert "# /p: its 5 messages were copied but cannot be read" in capsys.readouterr().out
    mapping.write_text('[channels."/table/encoder".fields]\nposition_m.column = "/good.x"\n')
    assert run(["import", str(bag), "--map", str(mapping), "-o", str(session)]) == 0
    with seamlog.open_session(session) as opened:
        assert opened.columns("/table/encoder")["position_m"].tolist() == [1.5] * 5


def test_definitions_are_completed_from_those_of_ros(
    tmp_path: Path, session: Path, capsys: Any
) -> None:
    text = HEAD + struct.pack("<iII", 1, 2, 2) + b"b\0\0\0" + struct.pack("<d", 2.5)
    schema = ("t/msg/N", "ros2msg", "Header header\nfloat64 x\n")
    code, told = imported(write_mcap(tmp_path / "x.mcap", schema, "cdr", text), session, capsys)
    assert (code, told["losses"]) == (0, [])
    assert "lacks the definition of std_msgs/msg/Header" in told["notes"][0]
    with seamlog.open_session(session) as opened:
        columns = opened.columns("/p")
    assert columns["x"].tolist() == [2.5] * 5
    assert columns["stamp_ns"].tolist() == [1_000_000_002] * 5


def test_a_message_without_fields_is_read(tmp_path: Path, session: Path, capsys: Any) -> None:
    schema = ("std_msgs/msg/Empty", "ros2msg", "")
    code, _ = imported(
        write_mcap(tmp_path / "x.mcap", schema, "cdr", HEAD + b"\0"), session, capsys
    )
    assert code == 0
    with seamlog.open_session(session) as opened:
        assert opened.columns("/p")["log_time_ns"].tolist() == list(range(5))


ROS1 = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)


def write_ros1(path: Path, compression: str = "", count: int = 600) -> Path:
    from rosbags.rosbag1 import Writer

    writer = Writer(path)
    writer.chunk_threshold = 4000
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression])
    types, name = ROS1.types, "geometry_msgs/msg/PointStamped"
    with writer:
        connection = writer.add_connection("/p", name, typestore=ROS1)
        for place in range(count):
            stamp = types["builtin_interfaces/msg/Time"](1_700_000_000, place)
            header = types["std_msgs/msg/Header"](place, stamp, "base")
            point = types["geometry_msgs/msg/Point"](float(place), 2.0, 3.0)
            raw = ROS1.serialize_ros1(types[name](header, point), name)
            writer.write(connection, START_NS + place, raw)
    return path


def read_p(session: Path) -> list[float]:
    with seamlog.open_session(session) as opened:
        found: list[float] = opened.columns("/p")["point.x"].tolist()
    return found


@pytest.mark.parametrize("compression", ["", "LZ4", "BZ2"])
@pytest.mark.parametrize("place", [0, 1 << 63], ids=["of a killed recorder", "beyond all files"])
def test_a_ros1_bag_without_an_index_is_walked(
    tmp_path: Path, session: Path, compression: str, place: int, capsys: Any
) -> None:
    bag = write_ros1(tmp_path / "x.bag", compression)
    data = bytearray(bag.read_bytes())
    at = data.find(b"index_pos=") + 10
    data[at : at + 8] = place.to_bytes(8, "little")
    bag.write_bytes(data)
    code, told = imported(bag, session, capsys)
    assert (code, told["losses"]) == (0, [])
    assert read_p(session) == list(range(600))


@pytest.mark.parametrize("compression", ["", "LZ4"])
def test_a_cut_ros1_bag_gives_what_is_there(
    tmp_path: Path, session: Path, compression: str, capsys: Any
) -> None:
    bag = write_ros1(tmp_path / "x.bag", compression)
    bag.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    code, told = imported(bag, session, capsys)
    assert code == 1 and "could not be read" in told["losses"][0]
    found = read_p(session)
    assert found == list(range(len(found))) and len(found) > 100


@pytest.mark.parametrize("data", [b"", b"#ROSBAG V2.0\n" + bytes(99), b"#ROSBAG V1.2\n"])
def test_what_is_no_ros1_bag_is_refused(
    tmp_path: Path, session: Path, data: bytes, capsys: Any
) -> None:
    (tmp_path / "x.bag").write_bytes(data)
    code, told = imported(tmp_path / "x.bag", session, capsys)
    assert code == 3 and "x.bag" in told["message"]
    assert not session.exists()


def test_damaged_ros1_bags_never_crash(tmp_path: Path, capsys: Any) -> None:
    data = write_ros1(tmp_path / "x.bag", count=50).read_bytes()
    rng = np.random.default_rng(0)
    for place in rng.integers(13, len(data), 60).tolist():
        broken = bytearray(data)
        broken[place] ^= 0xFF
        (tmp_path / "y.bag").write_bytes(broken)
        words = ["import", str(tmp_path / "y.bag"), "-o", str(tmp_path / "y.mcap"), "--force"]
        assert run(words) in (0, 1, 3), place
        capsys.readouterr()
