"""Definitions of ROS messages that a bag lacks, taken from ROS 2's own packages."""

import re
from typing import Any

from seamlog.errors import HardwareError
from seamlog.mcap.definitions import fields_of
from seamlog.mcap.records import Malformed, Schema

_NESTED = re.compile(r"^\s*((?:[A-Za-z]\w*/(?:msg/)?)?[A-Z]\w*)(?:\[[<=\d]*\])?\s", re.MULTILINE)
_LINE = "=" * 80


def schema_of(name: str, store: Any) -> Schema:
    """The definition of a message with all that it holds."""
    text, _ = store.generate_msgdef(name, ros_version=2)
    return Schema(0, name, "ros2msg", text.encode())


def own_packages() -> Any:
    """The messages of ROS 2's own packages, as rosbags knows them."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.LATEST)


def completed(schema: Schema | None, encoding: str) -> tuple[Schema | None, str]:
    """The schema, completed where it has to and can be, and what was added ("" if nothing).

    A schema that cannot be completed stays as it is.
    """
    if schema is None or encoding != "cdr" or schema.encoding not in ("ros2msg", ""):
        return schema, ""
    try:
        fields_of(schema)
    except HardwareError:
        return schema, ""
    except Malformed:
        pass
    else:
        return schema, ""
    try:
        store = own_packages()
    except ImportError:
        return schema, ""
    if not schema.data and schema.name in store.types:
        return schema_of(schema.name, store), f"the definition of {schema.name}"
    text = schema.data.decode(errors="replace")
    added = [name for name in _nested(text) if name in store.types]
    parts = [f"MSG: {name.replace('/msg/', '/')}\n{_definition(name, store)}" for name in added]
    whole = Schema(0, schema.name, "ros2msg", f"\n{_LINE}\n".join([text, *parts]).encode())
    try:
        fields_of(whole)
    except Malformed:
        return schema, ""
    return whole, f"the definition of {', '.join(added)}"


def _definition(name: str, store: Any) -> str:
    return str(store.generate_msgdef(name, ros_version=2)[0]).strip()


def _nested(text: str) -> list[str]:
    """Full names of the messages that fields of a definition have."""
    found = []
    for base in dict.fromkeys(_NESTED.findall(text)):
        package, _, name = base.replace("/msg/", "/").rpartition("/")
        found.append(f"{package or 'std_msgs'}/msg/{name}")
    return found
