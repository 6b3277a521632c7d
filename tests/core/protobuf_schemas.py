"""Protobuf message types for tests, built without a compiler."""

from typing import Any

from google.protobuf import descriptor_pb2, timestamp_pb2

TYPES = [
    "double", "float", "int64", "uint64", "int32", "fixed64", "fixed32", "bool", "string",
    "bytes", "uint32", "sfixed32", "sfixed64", "sint32", "sint64",
]  # fmt: skip


def add_field(
    message: Any, name: str, number: int, kind: str, repeated: bool = False, type_name: str = ""
) -> None:
    field = message.field.add()
    field.name, field.number = name, number
    field.type = getattr(field, f"TYPE_{kind.upper()}")
    field.label = field.LABEL_REPEATED if repeated else field.LABEL_OPTIONAL
    if type_name:
        field.type_name = type_name


def joint_states() -> Any:
    """A file set with `test.JointStates`: a time stamp and named joints."""
    file = descriptor_pb2.FileDescriptorProto(name="joints.proto", package="test", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    joint = file.message_type.add(name="JointState")
    add_field(joint, "name", 1, "string")
    for number, name in enumerate(("position", "velocity", "acceleration", "effort"), 2):
        add_field(joint, name, number, "double")
    states = file.message_type.add(name="JointStates")
    add_field(states, "timestamp", 1, "message", type_name=".google.protobuf.Timestamp")
    add_field(states, "joints", 2, "message", True, ".test.JointState")
    return file_set(file)


def everything() -> Any:
    """A file set with `test.All`: every type once, repeated, nested, and recursive."""
    file = descriptor_pb2.FileDescriptorProto(name="all.proto", package="test", syntax="proto3")
    file.enum_type.add(name="Mode").value.add(name="OFF", number=0)
    inner = file.message_type.add(name="Inner")
    add_field(inner, "x", 1, "double")
    add_field(inner, "words", 2, "string", True)
    tree = file.message_type.add(name="Tree")
    add_field(tree, "level", 1, "int32")
    add_field(tree, "children", 2, "message", True, ".test.Tree")
    whole = file.message_type.add(name="All")
    for number, kind in enumerate(TYPES, 1):
        add_field(whole, f"one_{kind}", number, kind)
        add_field(whole, f"many_{kind}", 50 + number, kind, True)
    add_field(whole, "inner", 100, "message", False, ".test.Inner")
    add_field(whole, "inners", 101, "message", True, ".test.Inner")
    add_field(whole, "tree", 102, "message", False, ".test.Tree")
    add_field(whole, "mode", 103, "enum", False, ".test.Mode")
    return file_set(file)


def file_set(*files: Any) -> Any:
    found = descriptor_pb2.FileDescriptorSet(file=files)
    timestamp_pb2.DESCRIPTOR.CopyToProto(found.file.add())
    return found
