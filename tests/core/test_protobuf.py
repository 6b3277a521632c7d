"""Protobuf messages, against the protobuf package as the oracle."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.json_format import MessageToDict
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

import seamlog
from seamlog.errors import SessionError
from seamlog.mcap import columns as columns_module
from seamlog.mcap import rows as rows_module
from tests.core.protobuf_schemas import TYPES, everything, joint_states

STAMP_NS = 1_767_225_600_000_000_123


def make_class(files: Any, name: str) -> Any:
    pool = descriptor_pool.DescriptorPool()
    for file in reversed(files.file):
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


ALL_FILES, JOINT_FILES = everything(), joint_states()
All, JointStates = make_class(ALL_FILES, "test.All"), make_class(JOINT_FILES, "test.JointStates")


def write(path: Path, payloads: list[bytes], files: Any, name: str, chunk: int = 1 << 20) -> Path:
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk)
        writer.start()
        schema = writer.register_schema(name, "protobuf", files.SerializeToString())
        channel = writer.register_channel("/x", "protobuf", schema)
        for time, payload in enumerate(payloads):
            writer.add_message(channel, time, payload, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def read(path: Path, fields: list[str] | None = None) -> dict[str, Any]:
    with seamlog.open_session(path) as session:
        return session.columns("/x", fields)


def joints(place: int, count: int) -> Any:
    message = JointStates()
    message.timestamp.FromNanoseconds(STAMP_NS + place * 999_983)
    for number in range(count):
        message.joints.add(name=f"joint{number}", position=place + number, effort=-number)
    return message


INTEGERS = {
    "int64": (-(2**63), 2**63 - 1), "uint64": (0, 2**64 - 1), "int32": (-(2**31), 2**31 - 1),
    "uint32": (0, 2**32 - 1), "fixed64": (0, 2**64 - 1), "fixed32": (0, 2**32 - 1),
    "sfixed32": (-(2**31), 2**31 - 1), "sfixed64": (-(2**63), 2**63 - 1),
    "sint32": (-(2**31), 2**31 - 1), "sint64": (-(2**63), 2**63 - 1),
}  # fmt: skip


def value_of(kind: str) -> st.SearchStrategy[Any]:
    if kind in INTEGERS:
        return st.integers(*INTEGERS[kind]) | st.integers(0, 300).filter(
            lambda value: value <= INTEGERS[kind][1]
        )
    if kind == "bool":
        return st.booleans()
    if kind in ("string", "bytes"):
        return st.text(max_size=4) if kind == "string" else st.binary(max_size=4)
    return st.floats(width=32 if kind == "float" else 64, allow_nan=False)


@st.composite
def messages(draw: st.DrawFn) -> Any:
    message = All()
    for kind in draw(st.lists(st.sampled_from(TYPES), max_size=5)):
        setattr(message, f"one_{kind}", draw(value_of(kind)))
    for kind in draw(st.lists(st.sampled_from(TYPES), max_size=3)):
        getattr(message, f"many_{kind}").extend(draw(st.lists(value_of(kind), max_size=3)))
    if draw(st.booleans()):
        message.inner.x = draw(value_of("double"))
    for words in draw(st.lists(st.lists(st.text(max_size=3), max_size=2), max_size=2)):
        message.inners.add(x=len(words), words=words)
    if draw(st.booleans()):
        message.tree.children.add(level=draw(st.integers(0, 9))).children.add(level=1)
    message.mode = draw(st.integers(0, 3))
    return message


def assert_all(columns: dict[str, Any], rows: list[Any]) -> None:
    for place, row in enumerate(rows):
        for kind in TYPES:
            assert columns[f"one_{kind}"][place] == getattr(row, f"one_{kind}")
            assert list(columns[f"many_{kind}"][place]) == list(getattr(row, f"many_{kind}"))
        assert columns["inner.x"][place] == row.inner.x
        assert list(columns["inners.x"][place]) == [item.x for item in row.inners]
        assert columns["inners.words"][place] == [list(item.words) for item in row.inners]
        wanted = MessageToDict(row.tree, preserving_proto_field_name=True)
        assert (columns["tree"][place] or {}) == wanted
        assert columns["mode"][place] == row.mode


@settings(max_examples=60, deadline=None)
@given(st.lists(messages(), min_size=1, max_size=6))
def test_any_message_decodes_as_it_was_encoded(rows: list[Any]) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        write(path, [row.SerializeToString() for row in rows], ALL_FILES, "test.All")
        assert_all(read(path), rows)


@settings(max_examples=30, deadline=None)
@given(st.lists(messages(), min_size=1, max_size=6))
def test_messages_too_varied_for_shapes_decode_the_same(rows: list[Any]) -> None:
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(columns_module, "_MANY_SHAPES", -1)
        path = Path(folder) / "x.mcap"
        write(path, [row.SerializeToString() for row in rows], ALL_FILES, "test.All")
        assert_all(read(path), rows)


def test_time_stamps_and_repeated_messages_become_columns(tmp_path: Path) -> None:
    rows = [joints(place, place % 4) for place in range(300)]
    payloads = [row.SerializeToString() for row in rows]
    columns = read(write(tmp_path / "x.mcap", payloads, JOINT_FILES, "test.JointStates"))
    assert columns["stamp_ns"].tolist() == [STAMP_NS + place * 999_983 for place in range(300)]
    assert columns["joints.name"][3] == ["joint0", "joint1", "joint2"]
    np.testing.assert_array_equal(columns["joints.position"][7], [7.0, 8.0, 9.0])
    assert columns["joints.velocity"][4].shape == (0,)


def test_chunks_are_read_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Uniform chunks and varied ones in turn; the order of the file stays."""
    monkeypatch.setattr(rows_module, "_JOIN_BYTES", 1000)
    monkeypatch.setattr(rows_module, "_MERGE_BYTES", 6000)
    rows = [joints(place, 2 if place // 100 % 2 else place % 5) for place in range(700)]
    payloads = [row.SerializeToString() for row in rows]
    path = write(tmp_path / "x.mcap", payloads, JOINT_FILES, "test.JointStates", 1500)
    columns = read(path)
    assert columns["log_time_ns"].tolist() == list(range(700))
    wanted = [[joint.effort for joint in row.joints] for row in rows]
    assert [values.tolist() for values in columns["joints.effort"]] == wanted
    assert columns["joints.name"].tolist() == [[joint.name for joint in r.joints] for r in rows]


def test_long_messages_among_short_ones(tmp_path: Path) -> None:
    rows = [All(one_string="x" * size, one_int32=size) for size in (3, 70_000, 3, 66_000, 70_000)]
    path = write(tmp_path / "x.mcap", [r.SerializeToString() for r in rows], ALL_FILES, "test.All")
    assert read(path, ["one_int32"])["one_int32"].tolist() == [3, 70_000, 3, 66_000, 70_000]


def test_one_field_can_be_picked(tmp_path: Path) -> None:
    payloads = [joints(place, 2).SerializeToString() for place in range(5)]
    path = write(tmp_path / "x.mcap", payloads, JOINT_FILES, "test.JointStates")
    assert set(read(path, ["joints.effort"])) == {"log_time_ns", "stamp_ns", "joints.effort"}


def test_an_empty_packed_field_is_an_empty_sequence(tmp_path: Path) -> None:
    number = next(field for field in All.DESCRIPTOR.fields if field.name == "many_int32").number
    tag = (number << 3 | 2) % 128 | 128, (number << 3 | 2) // 128
    payloads = [bytes([*tag, 0]), All(many_int32=[1, 300]).SerializeToString()]
    columns = read(write(tmp_path / "x.mcap", payloads, ALL_FILES, "test.All"))
    assert [values.tolist() for values in columns["many_int32"]] == [[], [1, 300]]
    assert columns["many_int32"][0].dtype == np.int32


@settings(max_examples=200, deadline=None)
@given(st.lists(st.integers(0, 2**64 - 1) | st.integers(0, 2**14), min_size=1, max_size=20))
def test_varints_of_every_length_are_exact(values: list[int]) -> None:
    rows = [
        All(one_uint64=value, one_string="x" * (place % 3)) for place, value in enumerate(values)
    ]
    rows += [All(one_int64=value - 2**63, one_sint64=value - 2**63) for value in values]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        write(path, [row.SerializeToString() for row in rows], ALL_FILES, "test.All")
        columns = read(path, ["one_uint64", "one_int64", "one_sint64"])
    for name in ("one_uint64", "one_int64", "one_sint64"):
        assert columns[name].tolist() == [getattr(row, name) for row in rows]


@pytest.mark.parametrize(
    "payload", [b"\x08", b"\x12\x7f", b"\x0a\x02\x08", b"\x0b", b"\x0a\x01\xff", b"\x09" + bytes(3)]
)
def test_bytes_that_are_no_such_message_are_refused(tmp_path: Path, payload: bytes) -> None:
    path = write(tmp_path / "x.mcap", [payload], JOINT_FILES, "test.JointStates")
    with pytest.raises(SessionError, match=r"x\.mcap: /x"):
        read(path)


def test_descriptors_that_do_not_hold_the_type_are_refused(tmp_path: Path) -> None:
    files = descriptor_pb2.FileDescriptorSet()
    path = write(tmp_path / "x.mcap", [b""], files, "test.Missing")
    with pytest.raises(SessionError, match=r"test\.Missing"):
        read(path)


def test_a_message_given_in_two_parts_is_merged(tmp_path: Path) -> None:
    """As protobuf asks of a field that is there twice."""
    one, two = All(), All()
    one.inner.x = 1.5
    two.inner.words.append("late")
    plain = All(one_int32=7).SerializeToString()
    payloads = [plain, one.SerializeToString() + two.SerializeToString(), plain]
    columns = read(write(tmp_path / "x.mcap", payloads, ALL_FILES, "test.All"))
    assert columns["inner.x"].tolist() == [0.0, 1.5, 0.0]
    assert columns["inner.words"].tolist() == [[], ["late"], []]
    assert columns["one_int32"].tolist() == [7, 0, 7]
