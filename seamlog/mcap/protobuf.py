"""Protobuf messages by learned shapes; the descriptors are read by the `protobuf` package.

What a message does not carry has its default, as everywhere in protobuf. A field whose message
type contains itself stays one dictionary per message.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import HardwareError
from seamlog.mcap.protobuf_fields import (
    BYTES,
    FIXED32,
    FIXED64,
    VARINT,
    Field,
    column_forms,
    fields_of,
    message_type,
    to_dict,
)
from seamlog.mcap.protobuf_values import decode_message
from seamlog.mcap.records import Malformed, Schema
from seamlog.mcap.rows import Batch, Rows
from seamlog.mcap.shapes import (
    Form,
    Forms,
    Leaf,
    NoShape,
    Read,
    Shape,
    Structure,
    Text,
    constant,
    empty_leaf,
    first_payload,
    numbers_leaf,
    objects,
    read_number,
    stacked_leaf,
)

_MAX_VARINT = 10


class ProtobufGrammar:
    """Reads the messages of a `FileDescriptorSet`."""

    def __init__(self, schema: Schema | None) -> None:
        if schema is None or schema.encoding != "protobuf":
            found = repr(schema.encoding) if schema else "no"
            raise Malformed(f"protobuf messages need a protobuf schema; its channel has {found}")
        try:
            self._type = message_type(schema.name, schema.data)
        except ImportError as error:
            raise HardwareError(
                "protobuf messages are read by the package protobuf: pip install 'seamlog[import]'"
            ) from error
        self._fields = fields_of(self._type)
        self.forms: Forms = dict(column_forms(self._fields))

    def learn(self, rows: Rows) -> Shape:
        """The shape of the first row; `Malformed` if it is no such message."""
        structure = Structure(first_payload(rows))
        walker = _Walker(structure)
        leaves = walker.message(self._fields, 0, len(structure.payload), "")
        return Shape(tuple(leaves), structure.checks())

    def decode(self, batch: Batch, names: Collection[str]) -> dict[str, NDArray[Any]]:
        """Columns of messages of any shape, one message after the other."""
        rows = [
            decode_message(self._type, self._fields, bytes(payload), names)
            for _, payload in batch.payloads()
        ]
        return {name: _column([row[name] for row in rows], self.forms[name]) for name in names}


def _column(values: list[Any], form: Form) -> NDArray[Any]:
    return objects(values) if form.dtype is object else np.array(values, form.dtype)


class _Walker:
    """Walks one message: tags, lengths and the ends of varints are its structure."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._payload = structure.payload

    def message(self, fields: dict[int, Field], at: int, end: int, prefix: str) -> Iterator[Leaf]:
        """Leaves of the message in `[at, end)`, absent fields among them."""
        found: dict[int, list[tuple[int, int, int]]] = {number: [] for number in fields}
        while at < end:
            tag, value_at = self._varint(at, end, 0xFF)
            number, wire = tag >> 3, tag & 7
            start, at = self._value(wire, value_at, end, fields.get(number))
            if number in found:
                found[number].append((wire, start, at))
        for number, field in fields.items():
            yield from self._field(field, found[number], prefix + field.name)

    def _value(self, wire: int, at: int, end: int, field: Field | None) -> tuple[int, int]:
        """Where a value begins and ends."""
        if wire == VARINT:
            return at, self._varint(at, end, 0x80)[1]
        if wire in (FIXED64, FIXED32):
            stop = at + (8 if wire == FIXED64 else 4)
            start = at
        elif wire == BYTES:
            size, start = self._varint(at, end, 0xFF)
            stop = start + size
        else:
            raise Malformed(f"wire type {wire} at byte {at} is none of those in use")
        if stop > end:
            raise Malformed(f"a field at byte {at} leaves its message, which ends at byte {end}")
        return start, stop

    def _varint(self, at: int, end: int, bits: int) -> tuple[int, int]:
        value = shift = 0
        for place in range(at, min(end, at + _MAX_VARINT)):
            byte = self._payload[place]
            self._structure.fix(place, place + 1, bits)
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value, place + 1
            shift += 7
        raise Malformed(f"a varint at byte {at} has no end")

    def _field(self, field: Field, found: list[tuple[int, int, int]], name: str) -> Iterator[Leaf]:
        if field.fields is not None:
            yield from self._messages(field, found, name)
        elif field.is_repeated:
            yield self._repeated(field, found, name)
        elif found:
            yield Leaf(name, self._one(field, *found[-1]))
        else:
            yield Leaf(name, constant(field.default, field.form))

    def _messages(
        self, field: Field, found: list[tuple[int, int, int]], name: str
    ) -> Iterator[Leaf]:
        assert field.fields is not None
        parts = [list(self.message(field.fields, start, end, "")) for _, start, end in found]
        if field.is_repeated and not parts:
            for inner, form in column_forms(field.fields, name + "."):
                yield empty_leaf(inner, form)
        elif field.is_repeated:
            for same in zip(*parts, strict=True):
                yield stacked_leaf(f"{name}.{same[0].name}", [leaf.read for leaf in same])
        elif len(parts) > 1:
            raise NoShape(f"field {name} is there {len(parts)} times and must be merged")
        else:
            for leaf in parts[0] if parts else _absent(field.fields):
                yield Leaf(f"{name}.{leaf.name}", leaf.read)

    def _one(self, field: Field, wire: int, start: int, end: int) -> Read:
        if wire != field.wire:
            raise Malformed(f"field {field.name} has wire type {wire} instead of {field.wire}")
        if wire == VARINT:
            return partial(_read_varint, at=start, size=end - start, field=field)
        if wire == BYTES:
            return _read_bytes(field, start, end)
        return read_number(start, field.form)

    def _repeated(self, field: Field, found: list[tuple[int, int, int]], name: str) -> Leaf:
        if not found:
            return empty_leaf(name, Form(field.form))
        if field.wire in (FIXED32, FIXED64) and len(found) == 1 and found[0][0] == BYTES:
            _, start, end = found[0]
            width = 8 if field.wire == FIXED64 else 4
            if (end - start) % width:
                raise Malformed(f"field {field.name} is no whole number of values")
            return numbers_leaf(name, start, field.form, (end - start) // width)
        elements = [x for part in found for x in self._elements(field, *part)]
        return stacked_leaf(name, elements) if elements else empty_leaf(name, Form(field.form))

    def _elements(self, field: Field, wire: int, start: int, end: int) -> Iterator[Read]:
        if wire == field.wire:
            yield self._one(field, wire, start, end)
            return
        if wire != BYTES or field.wire == BYTES:
            raise Malformed(f"field {field.name} has wire type {wire} instead of {field.wire}")
        while start < end:
            value_at, stop = self._value(field.wire, start, end, field)
            yield self._one(field, field.wire, value_at, stop)
            start = stop


def _absent(fields: dict[int, Field]) -> Iterator[Leaf]:
    for field in fields.values():
        if field.fields is None:
            yield _absent_leaf(field)
        elif field.is_repeated:
            for inner, form in column_forms(field.fields, field.name + "."):
                yield empty_leaf(inner, form)
        else:
            for leaf in _absent(field.fields):
                yield Leaf(f"{field.name}.{leaf.name}", leaf.read)


def _absent_leaf(field: Field) -> Leaf:
    if field.is_repeated:
        return empty_leaf(field.name, Form(field.form))
    return Leaf(field.name, constant(field.default, field.form))


def _read_varint(rows: Rows, at: int, size: int, field: Field) -> NDArray[Any]:
    value = _joined(rows, at, min(size, 8))
    if size > 8:
        value = value | _joined(rows, at + 8, size - 8) << np.uint64(56)
    if field.is_zigzag:
        value = (value >> np.uint64(1)) ^ (np.uint64(0) - (value & np.uint64(1)))
    return value != 0 if field.form == "?" else value.astype(field.form)


_STEPS = (
    (1, 0x007F007F007F007F),
    (2, 0x00003FFF00003FFF),
    (4, 0x000000000FFFFFFF),
)
"""Neighbours joined at each step: bytes of 7 bits, pairs of 14, fours of 28."""


def _joined(rows: Rows, at: int, size: int) -> NDArray[np.uint64]:
    """The low 7 bits of each of `size` (at most 8) bytes, as one number a row.

    The word that ends with them is read; it may begin in the record's head.
    """
    if size == 1:
        return (rows.column(at, "u1") & np.uint8(0x7F)).astype(np.uint64)
    value = rows.column(at + size - 8, "<u8") >> np.uint64(64 - 8 * size)
    value &= np.uint64(0x7F7F7F7F7F7F7F7F)
    for step, low in _STEPS[: (size - 1).bit_length()]:
        high = value & np.uint64(low << 8 * step)
        high >>= np.uint64(step)
        value &= np.uint64(low)
        value |= high
    return value


def _read_bytes(field: Field, start: int, end: int) -> Read:
    if field.is_text:
        return Text(start, end - start)
    make = partial(to_dict, field.recursive) if field.recursive else bytes

    def read(rows: Rows) -> NDArray[Any]:
        return objects([make(row.tobytes()) for row in rows.column(start, "u1", end - start)])

    return read
