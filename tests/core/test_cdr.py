"""CDR messages of any definition, against rosbags as the oracle."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import seamlog
from seamlog import messages
from seamlog.channels import CHANNELS
from seamlog.errors import SessionError, UnknownName
from seamlog.mcap import columns as columns_module
from seamlog.mcap.ros2msg import DefinitionError, parse

INTEGERS = {
    f"{sign}int{bits}": (0 if sign else -(1 << (bits - 1)), (1 << (bits if sign else bits - 1)) - 1)
    for sign in ("", "u")
    for bits in (8, 16, 32, 64)
}
PRIMITIVES = [*INTEGERS, "bool", "float32", "float64", "string"]
NESTED = "test_msgs/Inner"
INNER = "int8 a\nfloat64 b\nstring c\n"


def value_of(base: str) -> st.SearchStrategy[Any]:
    if base in INTEGERS:
        return st.integers(*INTEGERS[base])
    if base == "bool":
        return st.booleans()
    if base == "string":
        return st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=9)
    return st.floats(width=32 if base == "float32" else 64, allow_nan=False)


@st.composite
def definitions(draw: st.DrawFn) -> list[tuple[str, str, int]]:
    """Fields as (base, array text, count if fixed)."""
    fields = []
    for _ in range(draw(st.integers(1, 6))):
        base = draw(st.sampled_from([*PRIMITIVES, NESTED]))
        count = draw(st.integers(1, 3))
        array = draw(st.sampled_from(["", "[]", f"[{count}]", "[<=4]"]))
        fields.append((base, array, count))
    return fields


def draw_one(draw: st.DrawFn, base: str) -> Any:
    if base == NESTED:
        return tuple(draw(value_of(kind)) for kind in ("int8", "float64", "string"))
    return draw(value_of(base))


@st.composite
def recordings(draw: st.DrawFn) -> tuple[str, list[tuple[str, str, int]], list[list[Any]]]:
    fields = draw(definitions())
    lines = [f"{base}{array} f{place}" for place, (base, array, _) in enumerate(fields)]
    text = "\n".join(lines) + "\n" + "=" * 80 + f"\nMSG: {NESTED}\n{INNER}"
    rows = []
    for _ in range(draw(st.integers(1, 8))):
        row = []
        for base, array, count in fields:
            if not array:
                row.append(draw_one(draw, base))
                continue
            wanted = count if array == f"[{count}]" else draw(st.integers(0, 3))
            row.append([draw_one(draw, base) for _ in range(wanted)])
        rows.append(row)
    return text, fields, rows


def oracle_value(store: Any, base: str, array: str, value: Any) -> Any:
    if base == NESTED:
        inner = store.types["test_msgs/msg/Inner"]
        return [inner(*item) for item in value] if array else inner(*value)
    if array and base != "string":
        return np.array(value, {"bool": np.bool_}.get(base, base))
    return value


def write_recording(path: Path, text: str, payloads: list[bytes]) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        schema = writer.register_schema("test_msgs/msg/Outer", "ros2msg", text.encode())
        channel = writer.register_channel("/x", "cdr", schema)
        for time, payload in enumerate(payloads):
            writer.add_message(channel, time, payload, time)
        writer.finish()  # type: ignore[no-untyped-call]


@settings(max_examples=120, deadline=None)
@given(recordings())
def test_any_message_decodes_as_it_was_encoded(
    recording: tuple[str, list[tuple[str, str, int]], list[list[Any]]],
) -> None:
    check_recording(*recording)


@settings(max_examples=60, deadline=None)
@given(recordings())
def test_messages_too_varied_for_shapes_decode_the_same(
    recording: tuple[str, list[tuple[str, str, int]], list[list[Any]]],
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(columns_module, "_MANY_SHAPES", -1)
        check_recording(*recording)


def check_recording(text: str, fields: list[tuple[str, str, int]], rows: list[list[Any]]) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, "test_msgs/msg/Outer"))
    outer = store.types["test_msgs/msg/Outer"]
    payloads = []
    for row in rows:
        values = [
            oracle_value(store, base, array, value)
            for (base, array, _), value in zip(fields, row, strict=True)
        ]
        payloads.append(bytes(store.serialize_cdr(outer(*values), "test_msgs/msg/Outer")))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        write_recording(path, text, payloads)
        with seamlog.open_session(path) as session:
            columns = session.columns("/x")
    for place, (base, array, _) in enumerate(fields):
        for number, row in enumerate(rows):
            assert_field(columns, f"f{place}", base, array, number, row[place])


def assert_field(
    columns: dict[str, Any], name: str, base: str, array: str, number: int, value: Any
) -> None:
    if base == NESTED and not array:
        for part, wanted in zip("abc", value, strict=True):
            assert columns[f"{name}.{part}"][number] == wanted
    elif base == NESTED:
        for place, part in enumerate("abc"):
            assert list(columns[f"{name}.{part}"][number]) == [item[place] for item in value]
    elif array and base != "string":
        np.testing.assert_array_equal(columns[name][number], value)
    else:
        assert columns[name][number] == value


@given(st.lists(st.tuples(st.integers(-(2**63), 2**63 - 1), st.text(max_size=5)), max_size=3))
def test_our_own_encoder_agrees_with_rosbags(rows: list[tuple[int, str]]) -> None:
    channel = CHANNELS["/events"]
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(messages.definition(channel), channel.schema))
    event = store.types[channel.schema]
    for stamp, detail in rows:
        wanted = bytes(store.serialize_cdr(event(stamp, 3, detail), channel.schema))
        assert messages.encode(channel, (stamp, 3, detail)) == wanted


def test_big_endian_messages_are_read(tmp_path: Path) -> None:
    payload = b"\x00\x00\x00\x00" + (7).to_bytes(4, "big") + (2).to_bytes(4, "big") + b"a\x00"
    write_recording(tmp_path / "x.mcap", "uint32 number\nstring text\n", [payload])
    with seamlog.open_session(tmp_path / "x.mcap") as session:
        columns = session.columns("/x")
    assert columns["number"].tolist() == [7]
    assert columns["text"].tolist() == ["a"]


@pytest.mark.parametrize(
    ("text", "payload"),
    [
        ("float64 x\n", b"\x00\x01\x00\x00\x00\x00"),
        ("uint8 x\n", b"\x00\x01\x00\x00" + bytes(30)),
        ("uint8 x\n", b"\x00\x07\x00\x00\x00"),
        ("string x\n", b"\x00\x01\x00\x00\xff\xff\xff\xff"),
        ("string[] x\n", b"\x00\x01\x00\x00\xff\xff\xff\x7f"),
        ("string x\n", b"\x00\x01\x00\x00\x03\x00\x00\x00\xff\xfe\x00"),
        ("uint8 x\n", b""),
    ],
)
def test_a_message_that_does_not_fit_its_definition_is_refused(
    tmp_path: Path, text: str, payload: bytes
) -> None:
    write_recording(tmp_path / "x.mcap", text, [payload])
    with (
        seamlog.open_session(tmp_path / "x.mcap") as session,
        pytest.raises(SessionError, match=r"x\.mcap: /x"),
    ):
        session.columns("/x")


def test_constants_comments_and_defaults_are_no_fields() -> None:
    text = 'uint8 A=1 # one\nstring NAME="a # b"\n# whole line\n\nfloat64 x 1.5\nint8[<=3] y\n'
    assert [(node.name, node.base, node.count) for node in parse("a/msg/B", text)] == [
        ("x", "float64", None),
        ("y", "int8", -1),
    ]


@pytest.mark.parametrize(
    "text", ["Other x\n", "float64\n", "float64 x\nfloat64 x\n", "A x\n===\nMSG: p/A\nA y\n"]
)
def test_a_broken_definition_is_refused(text: str) -> None:
    with pytest.raises(DefinitionError):
        parse("p/msg/B", text)


def test_texts_of_any_length_are_read_alike(tmp_path: Path) -> None:
    """So varied that shapes give up, in both byte orders."""
    words = [("x" * (place * 7 % 41), "y" * (place * 11 % 37), place) for place in range(3000)]
    payloads = []
    for one, two, number in words:
        writer = messages.CdrWriter()
        for kind, value in (("string", one), ("string", two), ("int16", number)):
            writer.put(kind, value)
        payloads.append(writer.payload())
    payloads[5] = (
        b"\x00\x00\x00\x00"
        + (1).to_bytes(4, "big")
        + b"\x00\x00\x00\x00"
        + (1).to_bytes(4, "big")
        + b"\x00\x00"
        + (5).to_bytes(2, "big")
    )
    write_recording(tmp_path / "x.mcap", "string a\nstring b\nint16 n\n", payloads)
    with seamlog.open_session(tmp_path / "x.mcap") as session:
        columns = session.columns("/x")
    words[5] = ("", "", 5)
    assert list(zip(columns["a"], columns["b"], columns["n"].tolist(), strict=True)) == words


def test_elements_of_sequences_can_be_picked(tmp_path: Path) -> None:
    payloads = []
    for count in (2, 0, 3):
        writer = messages.CdrWriter()
        writer.put("float64[]", [1.5, 2.5, 3.5][:count])
        writer.put("string[]", ["a", "b", "c"][:count])
        payloads.append(writer.payload())
    write_recording(tmp_path / "x.mcap", "float64[] p\nstring[] s\n", payloads)
    with seamlog.open_session(tmp_path / "x.mcap") as session:
        columns = session.columns("/x", ["p[1]", "s[0]"])
        with pytest.raises(UnknownName, match=r"q\[0\]"):
            session.columns("/x", ["q[0]"])
    np.testing.assert_array_equal(columns["p[1]"], [2.5, np.nan, 2.5])
    assert columns["s[0]"].tolist() == ["a", None, "a"]
    assert set(columns) == {"log_time_ns", "p[1]", "s[0]"}
