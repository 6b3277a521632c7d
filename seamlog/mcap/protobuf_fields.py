"""Fields of protobuf messages, from the descriptors that a file carries."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from seamlog.mcap.records import Malformed
from seamlog.mcap.shapes import Form, sequence_of

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
_KINDS = {
    "double": (FIXED64, "<f8"),
    "float": (FIXED32, "<f4"),
    "int64": (VARINT, "i8"),
    "uint64": (VARINT, "u8"),
    "int32": (VARINT, "i4"),
    "fixed64": (FIXED64, "<u8"),
    "fixed32": (FIXED32, "<u4"),
    "bool": (VARINT, "?"),
    "string": (BYTES, object),
    "message": (BYTES, object),
    "bytes": (BYTES, object),
    "uint32": (VARINT, "u4"),
    "enum": (VARINT, "i4"),
    "sfixed32": (FIXED32, "<i4"),
    "sfixed64": (FIXED64, "<i8"),
    "sint32": (VARINT, "i4"),
    "sint64": (VARINT, "i8"),
}
_MAX_DEPTH = 32


@dataclass(frozen=True, slots=True)
class Field:
    """One field; `fields` are those of its message, None for values.

    `recursive` is the message type of a field whose type contains itself; such messages are not
    taken apart.
    """

    name: str
    kind: str
    wire: int
    form: Any
    default: Any
    is_repeated: bool
    fields: "dict[int, Field] | None" = None
    recursive: Any = None
    message: Any = None

    @property
    def kind_of_entry(self) -> Any:
        """Class of the entries of a map."""
        from google.protobuf.message_factory import GetMessageClass

        return GetMessageClass(self.message)

    @property
    def is_zigzag(self) -> bool:
        """Whether the sign stands in the lowest bit."""
        return self.kind in ("sint32", "sint64")

    @property
    def is_text(self) -> bool:
        """Whether the bytes are UTF-8."""
        return self.kind == "string"


def message_type(name: str, data: bytes) -> Any:
    """The descriptor of message `name` in a serialised FileDescriptorSet.

    `ImportError` without the protobuf package, `Malformed` if the descriptors cannot be used.
    """
    from google.protobuf import descriptor_pb2, descriptor_pool
    from google.protobuf.message import DecodeError

    files = descriptor_pb2.FileDescriptorSet()
    pool = descriptor_pool.DescriptorPool()
    try:
        files.ParseFromString(data)
        waiting = {file.name: file for file in files.file}
        _add_well_known(waiting)
        while waiting:
            _add(pool, waiting, next(iter(waiting)), 0)
        return pool.FindMessageTypeByName(name)
    except (DecodeError, TypeError, KeyError, ValueError) as error:
        raise Malformed(f"the descriptors of {name} cannot be used: {error}") from error


def _add(pool: Any, waiting: dict[str, Any], name: str, depth: int) -> None:
    file = waiting.pop(name, None)
    if file is None:
        return
    if depth > 1000:
        raise ValueError("its files import each other too deeply")
    for other in file.dependency:
        _add(pool, waiting, other, depth + 1)
    pool.Add(file)


def _add_well_known(waiting: dict[str, Any]) -> None:
    """Google's own types, which writers leave out of their descriptors."""
    from google.protobuf import (
        descriptor_pb2,
        duration_pb2,
        struct_pb2,
        timestamp_pb2,
        wrappers_pb2,
    )

    needed = {other for file in waiting.values() for other in file.dependency}
    for module in (timestamp_pb2, duration_pb2, struct_pb2, wrappers_pb2):
        name = module.DESCRIPTOR.name
        if name in needed and name not in waiting:
            copy = descriptor_pb2.FileDescriptorProto()
            module.DESCRIPTOR.CopyToProto(copy)
            waiting[name] = copy


def fields_of(message: Any, above: tuple[str, ...] = ()) -> dict[int, Field]:
    """Fields of a message type by number."""
    above = (*above, message.full_name)
    return {field.number: _field(field, above) for field in message.fields}


def _field(field: Any, above: tuple[str, ...]) -> Field:
    kind = _kind_of(field)
    wire, form = _KINDS[kind]
    repeated = bool(field.is_repeated)
    if kind != "message":
        default = [] if repeated else field.default_value
        return Field(field.name, kind, wire, form, default, repeated)
    inner = field.message_type
    if inner.full_name in above or len(above) > _MAX_DEPTH or _is_recursive(inner, ()):
        return Field(field.name, kind, wire, form, None, repeated, recursive=inner)
    return Field(field.name, kind, wire, form, None, repeated, fields_of(inner, above), None, inner)


def _is_recursive(message: Any, above: tuple[str, ...]) -> bool:
    if message.full_name in above or len(above) > _MAX_DEPTH:
        return True
    inside = (*above, message.full_name)
    inner = [field.message_type for field in message.fields if field.message_type]
    return any(_is_recursive(item, inside) for item in inner)


def _kind_of(field: Any) -> str:
    from google.protobuf.descriptor import FieldDescriptor

    names = {getattr(FieldDescriptor, f"TYPE_{name.upper()}"): name for name in _KINDS}
    if field.type not in names:
        raise Malformed(f"field {field.name} is a group, which is not read")
    return names[field.type]


def column_forms(fields: dict[int, Field], prefix: str = "") -> Iterator[tuple[str, Form]]:
    """The columns of a message type; what repeats is one sequence per message."""
    for field in fields.values():
        name = prefix + field.name
        if field.fields is None:
            yield name, sequence_of(Form(field.form)) if field.is_repeated else Form(field.form)
            continue
        for inner, form in column_forms(field.fields, name + "."):
            yield inner, sequence_of(form) if field.is_repeated else form


def to_dict(message: Any, data: bytes) -> dict[str, Any]:
    """A serialised message as a dictionary."""
    from google.protobuf.json_format import MessageToDict

    found: dict[str, Any] = MessageToDict(parsed(message, data), preserving_proto_field_name=True)
    return found


def parsed(message: Any, data: bytes) -> Any:
    """A message object; `Malformed` if the bytes are none."""
    from google.protobuf.message import DecodeError
    from google.protobuf.message_factory import GetMessageClass

    try:
        return GetMessageClass(message).FromString(data)
    except DecodeError as error:
        raise Malformed(f"a message is no {message.full_name}: {error}") from error
