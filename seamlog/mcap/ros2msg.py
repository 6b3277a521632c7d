"""Parses message definitions (ros2msg) into a tree of fields, nested messages with dotted names."""

import re
from dataclasses import dataclass
from functools import lru_cache

from seamlog.messages import PRIMITIVES

SEQUENCE = -1
_MAX_DEPTH = 32
_LINE = re.compile(
    r"(?P<base>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?:<=)?\d*\])?\s+(?P<name>[A-Za-z]\w*)(?P<rest>.*)"
)
_CONSTANT = re.compile(r"\s*=")
_TIME = "int32 sec\nuint32 nanosec\n"
_KNOWN = {
    "builtin_interfaces/Time": _TIME,
    "builtin_interfaces/Duration": _TIME,
    # the two primitive times of ROS 1
    "time": "uint32 secs\nuint32 nsecs\n",
    "duration": "int32 secs\nint32 nsecs\n",
}
_EMPTY = "uint8 structure_needs_at_least_one_member\n"


class DefinitionError(ValueError):
    """A message definition that cannot be read; the message names the line."""


@dataclass(frozen=True, slots=True)
class Node:
    """One field; `fields` is None for primitives and `string`.

    `count` is None for a single value, n for an array of n, `SEQUENCE` for any number.
    """

    name: str
    base: str
    count: int | None
    fields: "tuple[Node, ...] | None" = None


@lru_cache(maxsize=256)
def parse(name: str, text: str) -> tuple[Node, ...]:
    """Fields of the message `name` (`package/msg/Name`), nested ones resolved.

    Raises `DefinitionError`.
    """
    first, *rest = re.split(r"^=+[ \t]*\n", text.replace("\r\n", "\n"), flags=re.MULTILINE)
    definitions = dict(_KNOWN)
    for part in rest:
        head, _, body = part.partition("\n")
        if not head.startswith("MSG:"):
            raise DefinitionError(f"{name}: {head!r} where 'MSG: package/Name' belongs")
        definitions[_short(head.removeprefix("MSG:").strip())] = body
    definitions[_short(name)] = first
    return _fields(_short(name), definitions, 0)


def _short(name: str) -> str:
    return name.replace("/msg/", "/")


def _fields(name: str, definitions: dict[str, str], depth: int) -> tuple[Node, ...]:
    if depth > _MAX_DEPTH:
        raise DefinitionError(f"{name}: messages are nested more than {_MAX_DEPTH} deep")
    lines = definitions[name].splitlines()
    nodes = [_node(line, name, definitions, depth) for line in lines if _is_field(line)]
    if not nodes and depth:
        nodes = [_node(_EMPTY, name, definitions, depth)]
    names = [node.name for node in nodes]
    if len(set(names)) != len(names):
        raise DefinitionError(f"{name}: two fields of one name")
    return tuple(nodes)


def _is_field(line: str) -> bool:
    bare = line.split("#", 1)[0].strip()
    if not bare or bare.startswith("@"):
        return False
    match = _LINE.fullmatch(bare)
    if match is None:
        # a constant or default may hold '#' or have odd spacing; only its head matters
        match = _LINE.match(line.strip())
    if match is None:
        raise DefinitionError(f"{line.strip()!r} is no field of a message")
    return not _CONSTANT.match(match["rest"])


def _node(line: str, owner: str, definitions: dict[str, str], depth: int) -> Node:
    match = _LINE.match(line.strip())
    assert match is not None
    base, name, count = match["base"], match["name"], _count(match["array"])
    if base in PRIMITIVES or base == "string":
        return Node(name, base, count)
    if base == "wstring":
        raise DefinitionError(
            f"{owner}: {name} is a wstring, which middlewares write in different widths"
        )
    found = _resolve(base, owner, definitions)
    return Node(name, found, count, _fields(found, definitions, depth + 1))


def _count(array: str | None) -> int | None:
    if array is None:
        return None
    inner = array[1:-1]
    return int(inner) if inner.isdigit() else SEQUENCE


def _resolve(base: str, owner: str, definitions: dict[str, str]) -> str:
    package = owner.rpartition("/")[0]
    tries = (_short(base), f"{package}/{base}", f"std_msgs/{base}")
    for name in tries:
        if name in definitions:
            return name
    raise DefinitionError(f"{owner}: no definition of {base}")
