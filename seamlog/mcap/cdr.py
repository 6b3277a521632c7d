"""CDR messages (and those of ROS 1) of any definition."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap import cdr_walk
from seamlog.mcap.cdr_walk import Cursors
from seamlog.mcap.records import Malformed
from seamlog.mcap.ros2msg import SEQUENCE, Node
from seamlog.mcap.rows import PAYLOAD, Batch, Rows, taken
from seamlog.mcap.shapes import (
    Form,
    Forms,
    Leaf,
    Shape,
    Structure,
    Text,
    empty_leaf,
    first_payload,
    numbers_leaf,
    read_number,
    sequence_of,
    stacked_leaf,
)
from seamlog.messages import PRIMITIVES

_NUMPY = {"?": "?", "B": "u1", "b": "i1", "H": "u2", "h": "i2", "I": "u4", "i": "i4"}
_NUMPY |= {"Q": "u8", "q": "i8", "f": "f4", "d": "f8"}
_ENCAPSULATIONS = {b"\x00\x00": ">", b"\x00\x01": "<"}
_PADDING = 7
"""Writers may pad a payload; more bytes behind its last field mean another definition."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """What tells CDR from the serialisation of ROS 1."""

    header: int
    aligned: bool
    terminator: int
    """Bytes behind the text of a string."""


CDR, ROS1 = Dialect(4, True, 1), Dialect(0, False, 0)


def numpy_form(base: str) -> str:
    """Format of a column of a ROS primitive, in the machine's byte order."""
    return _NUMPY[PRIMITIVES[base]]


def column_forms(nodes: tuple[Node, ...], prefix: str = "") -> dict[str, Form]:
    """The columns of a message definition."""
    forms: dict[str, Form] = {}
    for node in nodes:
        name = prefix + node.name
        if node.fields is not None:
            inner = column_forms(node.fields, name + ".")
            if node.count is not None:
                inner = {key: sequence_of(form) for key, form in inner.items()}
            forms |= inner
        elif node.base == "string":
            forms[name] = Form(object, None, None if node.count is None else object)
        elif node.count == SEQUENCE:
            forms[name] = Form(object, None, numpy_form(node.base))
        else:
            forms[name] = Form(numpy_form(node.base), node.count)
    return forms


class CdrGrammar:
    """Reads the messages of a definition, by shapes or, where too varied, field by field."""

    def __init__(self, nodes: tuple[Node, ...], dialect: Dialect = CDR) -> None:
        self._nodes, self._dialect = nodes, dialect
        self.forms: Forms = column_forms(nodes)

    def learn(self, rows: Rows) -> Shape:
        """The shape of the first row; `Malformed` if it does not fit the definition."""
        structure = Structure(first_payload(rows))
        order = "<"
        if self._dialect.header:
            order = _order(structure.payload[:2])
            structure.fix(0, 2)
        walker = _Walker(structure, self._dialect, order)
        leaves = tuple(walker.leaves(self._nodes, ""))
        if len(structure.payload) - walker.at > _PADDING:
            raise Malformed(
                f"a message of {len(structure.payload)} bytes ends at byte {walker.at} by its "
                "definition"
            )
        return Shape(leaves, structure.checks())

    def decode(self, batch: Batch, names: Collection[str]) -> dict[str, NDArray[Any]]:
        """Columns of messages of any shape."""
        offsets, lengths = batch.places()
        starts, ends = offsets + PAYLOAD, offsets + lengths
        header = self._dialect.header
        if (ends - starts < header).any():
            raise Malformed(f"a message is shorter than its header of {header} bytes")
        if not header:
            return self._decode(
                Cursors(batch.data, starts, starts.copy(), ends, "<", self._dialect), names
            )
        found: dict[str, NDArray[Any]] = {}
        heads = taken(batch.data, starts, ">u2")
        for head in np.unique(heads).tolist():
            here = np.flatnonzero(heads == head)
            begun = starts[here] + header
            order = _order(head.to_bytes(2, "big"))
            cursors = Cursors(batch.data, begun, begun.copy(), ends[here], order, self._dialect)
            for name, column in self._decode(cursors, names).items():
                whole = found.setdefault(
                    name, np.empty((len(heads), *column.shape[1:]), column.dtype)
                )
                whole[here] = column
        return found

    def _decode(self, cursors: Cursors, names: Collection[str]) -> dict[str, NDArray[Any]]:
        return cdr_walk.decode(self._nodes, cursors, names)


def _order(encapsulation: bytes) -> str:
    order = _ENCAPSULATIONS.get(encapsulation)
    if order is None:
        raise Malformed(
            f"encapsulation {encapsulation.hex()} is none of plain CDR (0000, 0001); "
            "convert the file with the tool that wrote it"
        )
    return order


class _Walker:
    """Walks one message and notes counts and leaves."""

    def __init__(self, structure: Structure, dialect: Dialect, order: str) -> None:
        self._structure, self._dialect, self._order = structure, dialect, order
        self.at = dialect.header

    def leaves(self, nodes: tuple[Node, ...], prefix: str) -> Iterator[Leaf]:
        for node in nodes:
            name = prefix + node.name
            if node.fields is not None and node.count is None:
                yield from self.leaves(node.fields, name + ".")
            elif node.fields is not None:
                yield from self._records(name, node.fields, node)
            elif node.base == "string":
                yield self._text(name, node)
            else:
                yield self._number(name, node)

    def _align(self, width: int) -> None:
        if self._dialect.aligned:
            self.at += -(self.at - self._dialect.header) % width

    def _step(self, size: int) -> int:
        start, whole = self.at, len(self._structure.payload)
        if start + size > whole:
            raise Malformed(f"a field at byte {start} needs {size} bytes of a message of {whole}")
        self.at += size
        return start

    def _count(self) -> int:
        self._align(4)
        at = self._step(4)
        self._structure.fix(at, at + 4)
        (value,) = struct.unpack_from(self._order + "I", self._structure.payload, at)
        return int(value)

    def _number(self, name: str, node: Node) -> Leaf:
        code = PRIMITIVES[node.base]
        width = struct.calcsize("<" + code)
        count = self._count() if node.count == SEQUENCE else node.count
        if count is None or count:
            self._align(width)
        at = self._step(width * (1 if count is None else count))
        form = "?" if code == "?" else self._order + _NUMPY[code]
        if node.count == SEQUENCE:
            return numbers_leaf(name, at, form, count or 0)
        return Leaf(name, read_number(at, form, count))

    def _one_text(self) -> Text:
        size = self._count()
        return Text(self._step(size), max(size - self._dialect.terminator, 0))

    def _text(self, name: str, node: Node) -> Leaf:
        if node.count is None:
            return Leaf(name, self._one_text())
        count = self._bounded(self._count() if node.count == SEQUENCE else node.count, 4)
        return stacked_leaf(name, [self._one_text() for _ in range(count)])

    def _records(self, name: str, fields: tuple[Node, ...], node: Node) -> Iterator[Leaf]:
        count = self._count() if node.count == SEQUENCE else node.count
        elements = [list(self.leaves(fields, "")) for _ in range(self._bounded(count or 0, 1))]
        if not elements:
            for inner, form in column_forms(fields).items():
                yield empty_leaf(f"{name}.{inner}", form)
        for same in zip(*elements, strict=True):
            yield stacked_leaf(f"{name}.{same[0].name}", [leaf.read for leaf in same])

    def _bounded(self, count: int, width: int) -> int:
        whole = len(self._structure.payload)
        if count * width > whole:
            raise Malformed(f"{count} elements in a message of {whole} bytes")
        return count
