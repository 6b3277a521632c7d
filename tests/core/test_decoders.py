"""Decoders as plug-ins: ours, those of others, and encodings nobody decodes."""

import json
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

import seamlog
from seamlog import plugins
from seamlog.errors import PluginFailed, SessionError
from seamlog.mcap.decoders import OWN


def write(path: Path, encoding: str, schema: tuple[str, str, bytes], payloads: list[bytes]) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        number = writer.register_schema(*schema) if schema[0] else 0
        channel = writer.register_channel("/x", encoding, number)
        for time, payload in enumerate(payloads):
            writer.add_message(channel, time, payload, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def columns(path: Path) -> dict[str, Any]:
    with seamlog.open_session(path) as session:
        return session.columns("/x")


def test_our_own_are_entry_points_too() -> None:
    found = {name: entry.value for name, entry in plugins.available("seamlog.decoders").items()}
    assert found == OWN


def reversed_json(schema: Any) -> Any:
    return lambda payload: json.loads(payload[::-1])


def failing(schema: Any) -> Any:
    return lambda payload: 1 / len(payload[:0])


class McapFactory:
    """As the packages that decode for `mcap` look."""

    def decoder_for(self, message_encoding: str, schema: Any) -> Any:
        return reversed_json(schema) if schema and schema.name == "known" else None


@pytest.fixture
def plugin(monkeypatch: pytest.MonkeyPatch) -> Any:
    def install(factory: str) -> None:
        entry = EntryPoint("odd", f"{__name__}:{factory}", "seamlog.decoders")
        monkeypatch.setattr(plugins, "available", lambda group: {"odd": entry})
        monkeypatch.setattr(EntryPoint, "load", lambda self: globals()[factory])

    return install


@pytest.mark.parametrize("factory", ["reversed_json", "McapFactory"])
def test_a_decoder_of_others_makes_columns(tmp_path: Path, plugin: Any, factory: str) -> None:
    plugin(factory)
    payloads = [json.dumps({"a": {"b": place}})[::-1].encode() for place in range(3)]
    path = write(tmp_path / "x.mcap", "odd", ("known", "odd", b"1"), payloads)
    assert columns(path)["a.b"].tolist() == [0, 1, 2]


def test_a_decoder_that_knows_no_such_schema_is_said(tmp_path: Path, plugin: Any) -> None:
    plugin("McapFactory")
    path = write(tmp_path / "x.mcap", "odd", ("other", "odd", b"1"), [b"{}"])
    with pytest.raises(SessionError, match="McapFactory"):
        columns(path)


def test_a_decoder_that_raises_is_named(tmp_path: Path, plugin: Any) -> None:
    plugin("failing")
    path = write(tmp_path / "x.mcap", "odd", ("known", "odd", b"1"), [b"{}"])
    with pytest.raises(PluginFailed, match="ZeroDivisionError"):
        columns(path)


@pytest.mark.parametrize(
    ("encoding", "schema", "said"),
    [
        ("flatbuffer", ("a", "flatbuffer", b"1"), "no decoder"),
        ("cdr", ("", "", b""), "no message definition"),
        ("cdr", ("a/msg/B", "ros2msg", b""), "no message definition"),
        ("cdr", ("a/msg/B", "xsd", b"<a/>"), "'xsd' form"),
        ("cdr", ("a/msg/B", "ros2msg", b"Missing x\n"), "no definition of Missing"),
        ("cdr", ("a/msg/B", "ros2idl", b"module {"), "cannot be read"),
        ("protobuf", ("a.B", "ros2msg", b"int8 x\n"), "protobuf schema"),
    ],
)
def test_what_cannot_be_decoded_is_said(
    tmp_path: Path, encoding: str, schema: tuple[str, str, bytes], said: str
) -> None:
    path = write(tmp_path / "x.mcap", encoding, schema, [b"abcd"])
    with pytest.raises(SessionError, match=said):
        columns(path)


def test_messages_of_ros_1_are_read(tmp_path: Path) -> None:
    text = b"time stamp\nstring name\nfloat64[] values\n"
    payload = bytes.fromhex("010000000200000002000000") + b"ab"
    payload += bytes.fromhex("01000000") + bytes.fromhex("000000000000f03f")
    found = columns(write(tmp_path / "x.mcap", "ros1", ("a/B", "ros1msg", text), [payload]))
    assert found["stamp_ns"].tolist() == [1_000_000_002]
    assert found["name"].tolist() == ["ab"]
    assert found["values"][0].tolist() == [1.0]


def test_definitions_in_idl_are_read(tmp_path: Path) -> None:
    text = b"module a { module msg { struct B { double x; sequence<short> y; string s; }; }; };"
    payload = (
        bytes.fromhex("00010000000000000000f03f0200000005000600")
        + bytes.fromhex("02000000")
        + b"z\0"
    )
    found = columns(write(tmp_path / "x.mcap", "cdr", ("a/msg/B", "ros2idl", text), [payload]))
    assert (found["x"][0], found["y"][0].tolist(), found["s"][0]) == (1.0, [5, 6], "z")


def test_files_whose_messages_have_other_keys_are_one_session(tmp_path: Path) -> None:
    paths = [
        write(tmp_path / f"{name}.mcap", "json", ("s", "jsonschema", b"{}"), [text])
        for name, text in (("a", b'{"x": 1, "y": 2}'), ("b", b'{"x": 3, "word": "ab"}'))
    ]
    with seamlog.open_session(paths) as session:
        found = session.columns("/x")
    assert found["x"].tolist() == [1, 3]
    assert str(found["y"].tolist()) == "[2.0, nan]"
    assert found["word"].tolist() == [None, "ab"]
