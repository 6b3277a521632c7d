"""Decodes CDR messages of any definition, many at a time.

One message of a given length is walked to learn its *shape*: where each value lies, and the
counts (of strings and sequences) that fix it. All messages with the same counts have the same
shape, so their columns are cut out of the whole batch at once; the rest teaches the next shape.
"""

import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap.records import Malformed
from seamlog.mcap.ros2msg import SEQUENCE, Node
from seamlog.mcap.rows import PAYLOAD, Rows
from seamlog.messages import PRIMITIVES

_NUMPY = {"?": "u1", "B": "u1", "b": "i1", "H": "u2", "h": "i2", "I": "u4", "i": "i4"}
_NUMPY |= {"Q": "u8", "q": "i8", "f": "f4", "d": "f8"}
_ENCAPSULATIONS = {b"\x00\x00": ">", b"\x00\x01": "<"}
_HEADER = 4
_PADDING = 7
"""Writers may pad a payload; more bytes behind its last field mean another definition."""


def numpy_form(base: str) -> str:
    """Format of a column of a ROS 2 primitive, in the machine's byte order."""
    return "?" if base == "bool" else _NUMPY[PRIMITIVES[base]]


@dataclass(frozen=True, slots=True)
class Leaf:
    """One column: its dotted name and how to cut it out of rows of one shape."""

    name: str
    read: Callable[[Rows], NDArray[Any]]


@dataclass(slots=True)
class Shape:
    """Where the values of messages of one length and one set of counts lie."""

    order: str
    leaves: list[Leaf] = field(default_factory=list)
    counts: list[tuple[int, int]] = field(default_factory=list)
    """Offset in the payload and value of each uint32 count."""

    def matches(self, rows: Rows) -> NDArray[np.bool_]:
        """Which rows have this shape."""
        head = next(key for key, order in _ENCAPSULATIONS.items() if order == self.order)
        same: NDArray[np.bool_] = rows.column(0, ">u2") == int.from_bytes(head, "big")
        for offset, value in self.counts:
            same &= rows.column(offset, self.order + "u4") == value
        return same


def learn(nodes: tuple[Node, ...], rows: Rows) -> Shape:
    """The shape of the first row; `Malformed` if it does not fit the definition."""
    payload = bytes(rows.column(0, "u1", rows.length - PAYLOAD)[0])
    order = _ENCAPSULATIONS.get(payload[:2])
    if order is None:
        raise Malformed(
            f"encapsulation {payload[:2].hex()} is none of plain CDR (0000, 0001); "
            "convert the file with the tool that wrote it"
        )
    walker = _Walker(payload, Shape(order))
    walker.shape.leaves.extend(walker.leaves(nodes, ""))
    if len(payload) - walker.at > _PADDING:
        raise Malformed(
            f"a message of {len(payload)} bytes ends at byte {walker.at} by its definition"
        )
    return walker.shape


class _Walker:
    """Walks one message and notes counts and leaves."""

    def __init__(self, payload: bytes, shape: Shape) -> None:
        self._payload, self.shape = payload, shape
        self.at = _HEADER

    def leaves(self, nodes: tuple[Node, ...], prefix: str) -> Iterator[Leaf]:
        for node in nodes:
            name = prefix + node.name
            if node.fields is not None and node.count is None:
                yield from self.leaves(node.fields, name + ".")
            elif node.fields is not None:
                yield self._records(name, node)
            elif node.base == "string":
                yield self._text(name, node)
            else:
                yield self._number(name, node)

    def _align(self, width: int) -> None:
        self.at += -(self.at - _HEADER) % width

    def _step(self, size: int) -> int:
        start = self.at
        if start + size > len(self._payload):
            raise Malformed(
                f"a field at byte {start} needs {size} bytes of a message of {len(self._payload)}"
            )
        self.at += size
        return start

    def _count(self) -> int:
        self._align(4)
        at = self._step(4)
        (value,) = struct.unpack_from(self.shape.order + "I", self._payload, at)
        self.shape.counts.append((at, value))
        return int(value)

    def _number(self, name: str, node: Node) -> Leaf:
        code = PRIMITIVES[node.base]
        width = struct.calcsize("<" + code)
        count = self._count() if node.count == SEQUENCE else node.count
        if count is None or count:
            self._align(width)
        at = self._step(width * (1 if count is None else count))
        form = self.shape.order + _NUMPY[code]
        return Leaf(name, _number_reader(at, form, count, code == "?", node.count == SEQUENCE))

    def _one_text(self) -> tuple[int, int]:
        size = self._count()
        return self._step(size), max(size - 1, 0)

    def _text(self, name: str, node: Node) -> Leaf:
        if node.count is None:
            place = self._one_text()
            return Leaf(name, lambda rows: _texts(rows, *place))
        count = self._bounded(self._count() if node.count == SEQUENCE else node.count, 4)
        places = [self._one_text() for _ in range(count)]
        return Leaf(name, lambda rows: _lists([_texts(rows, *place) for place in places], rows))

    def _records(self, name: str, node: Node) -> Leaf:
        assert node.fields is not None
        count = self._count() if node.count == SEQUENCE else node.count
        elements = [list(self.leaves(node.fields, "")) for _ in range(self._bounded(count or 0, 1))]
        return Leaf(name, lambda rows: _lists([_dicts(leaves, rows) for leaves in elements], rows))

    def _bounded(self, count: int, width: int) -> int:
        if count * width > len(self._payload):
            raise Malformed(f"{count} elements in a message of {len(self._payload)} bytes")
        return count


def _number_reader(
    at: int, form: str, count: int | None, is_bool: bool, is_sequence: bool
) -> Callable[[Rows], NDArray[Any]]:
    def read(rows: Rows) -> NDArray[Any]:
        values = rows.column(at, form, count)
        if is_bool:
            values = values != 0
        if is_sequence:
            return _objects(values.astype(values.dtype.newbyteorder("=")))
        return values

    return read


def _objects(values: Collection[Any]) -> NDArray[Any]:
    return np.fromiter(values, object, len(values))


def _texts(rows: Rows, at: int, size: int) -> NDArray[Any]:
    raw = rows.column(at, "u1", size)
    if (raw == raw[0]).all():
        return np.full(rows.count, _decoded(bytes(raw[0])), object)
    data = raw.tobytes()
    parts = [data[start : start + size] for start in range(0, len(data), size)]
    return _objects([_decoded(part) for part in parts])


def _decoded(data: bytes) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise Malformed(f"a string is not UTF-8: {error.reason}") from error


def _lists(columns: list[NDArray[Any]], rows: Rows) -> NDArray[Any]:
    if not columns:
        return _objects([[] for _ in range(rows.count)])
    return _objects([list(values) for values in zip(*columns, strict=True)])


def _dicts(leaves: list[Leaf], rows: Rows) -> NDArray[Any]:
    names = [leaf.name for leaf in leaves]
    columns = [leaf.read(rows) for leaf in leaves]
    return _objects([dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)])
