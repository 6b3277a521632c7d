"""Grammars of ROS messages, from the definitions that files carry: ros2msg, ros2idl, ros1msg."""

from typing import Any

from seamlog.errors import HardwareError
from seamlog.mcap.cdr import CDR, ROS1, CdrGrammar
from seamlog.mcap.one_by_one import decode_json
from seamlog.mcap.records import Malformed, Schema
from seamlog.mcap.ros2msg import SEQUENCE, DefinitionError, Node, parse
from seamlog.messages import PRIMITIVES

_MAX_DEPTH = 32


def cdr(schema: Schema | None) -> CdrGrammar:
    """Grammar of CDR messages; `Malformed` if the definition cannot be read."""
    return CdrGrammar(fields_of(schema), CDR)


def ros1(schema: Schema | None) -> CdrGrammar:
    """Grammar of messages as ROS 1 serialises them."""
    return CdrGrammar(fields_of(schema), ROS1)


def json(schema: Schema | None) -> Any:
    """JSON needs no definition."""
    return decode_json


def fields_of(schema: Schema | None) -> tuple[Node, ...]:
    """Fields of a message by its definition; `Malformed` if that cannot be read."""
    if schema is None or not (schema.data or schema.name.endswith("/Empty")):
        raise Malformed(
            "its channel has no message definition, so its bytes cannot be told apart; "
            "record or convert it with definitions"
        )
    try:
        text = schema.data.decode()
        if schema.encoding in ("ros2idl", "omgidl"):
            return _from_idl(schema.name, text)
        if schema.encoding in ("ros2msg", "ros1msg"):
            return parse(schema.name, text)
    except (DefinitionError, UnicodeDecodeError) as error:
        raise Malformed(f"the definition of {schema.name} cannot be read: {error}") from error
    raise Malformed(
        f"the definition of {schema.name} is in {schema.encoding!r} form; read are ros2msg, "
        "ros2idl and ros1msg"
    )


def _from_idl(name: str, text: str) -> tuple[Node, ...]:
    try:
        from rosbags.typesys import TypesysError, get_types_from_idl
    except ImportError as error:
        raise HardwareError(
            f"{name} is defined in IDL, which rosbags reads: pip install 'seamlog[import]'"
        ) from error
    try:
        types = get_types_from_idl(text)
    except TypesysError as error:
        raise DefinitionError(str(error)) from error
    return from_rosbags(name, types)


def from_rosbags(name: str, types: Any, depth: int = 0) -> tuple[Node, ...]:
    """Fields of a message in the form that rosbags keeps definitions in."""
    from rosbags.interfaces import Nodetype

    if name not in types:
        raise DefinitionError(f"no definition of {name}")
    if depth > _MAX_DEPTH:
        raise DefinitionError(f"{name}: messages are nested more than {_MAX_DEPTH} deep")
    nodes = []
    for field, (kind, detail) in types[name][1]:
        count = None
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (kind, detail), size = detail
            count = size if kind != Nodetype.SEQUENCE and size else SEQUENCE
        nodes.append(_rosbags_node(field, kind, detail, count, types, depth))
    return tuple(nodes)


def _rosbags_node(
    field: str, kind: Any, detail: Any, count: int | None, types: Any, depth: int
) -> Node:
    from rosbags.interfaces import Nodetype

    if kind == Nodetype.NAME:
        return Node(field, detail, count, from_rosbags(detail, types, depth + 1))
    base = {"octet": "uint8", "char": "uint8"}.get(detail[0], detail[0])
    if base not in PRIMITIVES and base != "string":
        raise DefinitionError(f"{field}: type {base} is not read")
    return Node(field, base, count)
