"""Shapes: where the values of messages that are built alike lie.

One message of a given length is walked to learn its shape: each value's place, and the bits that
fix these places (counts, tags, lengths). Messages that agree in those bits have the same shape, so
their columns are cut out of a whole batch at once; the rest teaches the next shape.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap.records import Malformed
from seamlog.mcap.rows import PAYLOAD, Batch, Rows

Read: TypeAlias = Callable[[Rows], NDArray[Any]]
_SHORT_TEXT = 64


@dataclass(frozen=True, slots=True)
class Form:
    """What a column is: its dtype, and the length of a fixed array (None for a value).

    `element` is the dtype of the elements where a column holds one sequence per message.
    """

    dtype: Any
    count: int | None = None
    element: Any = None


Forms = Mapping[str, Form]
"""Columns by name."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """One column: its dotted name and how to cut it out of rows of one shape.

    A sequence can also be read element by element: `element(i)` reads the i-th of `count`.
    """

    name: str
    read: Read
    count: int = 0
    element: Callable[[int], Read] | None = None


class Check(NamedTuple):
    """The word of form `form` at byte `at` of the payload equals `value` in the bits of `mask`."""

    at: int
    form: str
    mask: int | None
    value: int


@dataclass(frozen=True, slots=True)
class Shape:
    """Where the values of messages of one length lie, and what such messages agree in."""

    leaves: tuple[Leaf, ...]
    checks: tuple[Check, ...]

    def matches(self, rows: Rows) -> NDArray[np.bool_]:
        """Which rows have this shape."""
        same: NDArray[np.bool_] | None = None
        for at, form, mask, value in self.checks:
            word = rows.column(at, form)
            hit = word == value if mask is None else word & word.dtype.type(mask) == value
            same = hit if same is None else same & hit
        return np.ones(rows.count, np.bool_) if same is None else same


class NoShape(Exception):
    """A message is valid and has no shape; it must be decoded on its own."""


@runtime_checkable
class Grammar(Protocol):
    """How the messages of one schema are read."""

    forms: Forms

    def learn(self, rows: Rows) -> Shape:
        """The shape of the first row; `Malformed` if it does not fit the schema.

        Raises `NoShape` where only `decode` can read it.
        """
        ...

    def decode(self, batch: Batch, names: Collection[str]) -> dict[str, NDArray[Any]]:
        """Columns of messages of any shape, where they are too varied to learn."""
        ...


class Structure:
    """The structural bits of one message, gathered while it is walked."""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload
        self._mask = bytearray(len(payload))

    def fix(self, start: int, end: int, bits: int = 0xFF) -> None:
        """The `bits` of each byte of `[start, end)` are structure."""
        for place in range(start, end):
            self._mask[place] |= bits

    def checks(self) -> tuple[Check, ...]:
        """As few words as hold all structural bits."""
        found, reached, size = [], 0, len(self._mask)
        for at in np.flatnonzero(np.frombuffer(self._mask, np.uint8)).tolist():
            if at < reached:
                continue
            reached = at + len(self._mask[at : at + 8].rstrip(b"\0"))
            width = next(width for width in (1, 2, 4, 8) if width >= reached - at)
            found.append(self._check(min(at, size - width), width))
        return tuple(found)

    def _check(self, start: int, width: int) -> Check:
        """A word may begin in front of the payload: a record's head is longer than any word."""
        place = max(start, 0)
        shift = 8 * (place - start)
        mask = int.from_bytes(self._mask[place : start + width], "little") << shift
        value = int.from_bytes(self.payload[place : start + width], "little") << shift
        whole = (1 << 8 * width) - 1
        return Check(start, f"<u{width}", None if mask == whole else mask, value & mask)


def numbers_leaf(name: str, at: int, form: str, count: int) -> Leaf:
    """A sequence of numbers: one array per row."""
    width = 1 if form == "?" else np.dtype(form).itemsize
    read = read_number(at, form, count, as_objects=True)
    return Leaf(name, read, count, lambda place: read_number(at + place * width, form))


def stacked_leaf(name: str, reads: Sequence[Read]) -> Leaf:
    """A sequence read one element at a time: one array (a list, of objects) per row."""
    places = [read for read in reads if isinstance(read, Text)]
    if len(places) == len(reads):
        return Leaf(name, read_texts(places), len(places), lambda place: places[place])
    return Leaf(
        name,
        lambda rows: stacked([read(rows) for read in reads]),
        len(reads),
        lambda place: reads[place],
    )


def empty_leaf(name: str, form: Form) -> Leaf:
    """A sequence without elements, of what is `form` in each element."""
    return Leaf(name, constant(empty_of(form), object))


def read_number(at: int, form: str, count: int | None = None, as_objects: bool = False) -> Read:
    """Reads a number, `count` numbers, or (`as_objects`) one array of numbers per row."""
    is_bool = form == "?"
    kind = "u1" if is_bool else form

    def read(rows: Rows) -> NDArray[Any]:
        values = rows.column(at, kind, count)
        if is_bool:
            values = values != 0
        return objects(native(values)) if as_objects else values

    return read


def native(values: NDArray[Any]) -> NDArray[Any]:
    """A copy in the machine's byte order."""
    return values.astype(values.dtype.newbyteorder("="))


def objects(values: Collection[Any]) -> NDArray[Any]:
    """One object per row."""
    return np.fromiter(values, object, len(values))


def constant(value: Any, form: Any) -> Read:
    """Reads the same value from each row; lists and arrays are made anew for each."""
    if isinstance(value, list | np.ndarray):
        return lambda rows: objects([value.copy() for _ in range(rows.count)])
    if form is object:
        return lambda rows: repeated(value, rows.count)
    return lambda rows: np.full(rows.count, value, form)


def repeated(value: Any, count: int) -> NDArray[Any]:
    """The same object in each row; `np.full` would strip NULs at the end of a text."""
    column = np.empty(count, object)
    column.fill(value)
    return column


def empty_of(form: Form) -> Any:
    """What a sequence of no records has in a column of this form."""
    if form.dtype is object:
        return []
    return np.empty(0 if form.count is None else (0, form.count), form.dtype)


def sequence_of(form: Form) -> Form:
    """The form of a column of sequences of what has `form`."""
    return Form(object, None, form.dtype if form.count is None else object)


@dataclass(frozen=True, slots=True)
class Text:
    """Reads UTF-8 text of `size` bytes at `at`."""

    at: int
    size: int

    def __call__(self, rows: Rows) -> NDArray[Any]:
        """One text per row."""
        if self.is_same(rows):
            return repeated(self.first(rows), rows.count)
        raw, size = rows.column(self.at, "u1", self.size), self.size
        starts = range(0, rows.count * size, size)
        return texts(
            raw.tobytes().decode("latin-1"), starts, range(size, (rows.count + 1) * size, size)
        )

    def first(self, rows: Rows) -> str:
        """The text of the first row."""
        return decoded(bytes(rows.column(self.at, "u1", self.size)[0]))

    def is_same(self, rows: Rows) -> bool:
        """Whether all rows have the same text; a word at a time where it is short."""
        if rows.count == 1:
            return True
        if self.size > _SHORT_TEXT:
            raw = rows.column(self.at, "u1", self.size)
            return bool((raw == raw[0]).all())
        for at in range(0, self.size, 8):
            width = min(8, self.size - at)
            words = rows.column(self.at + at + width - 8, "<u8") >> np.uint64(64 - 8 * width)
            if (words != words[0]).any():
                return False
        return True


def read_texts(places: Sequence[Text]) -> Read:
    """Reads a list of texts."""

    def read(rows: Rows) -> NDArray[Any]:
        if all(text.is_same(rows) for text in places):
            return constant([text.first(rows) for text in places], object)(rows)
        return lists([text(rows) for text in places])

    return read


def stacked(columns: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """One array (a list, of objects) per row, out of one column per record."""
    first = columns[0]
    if first.dtype == object:
        return lists(columns)
    table = np.empty((len(first), len(columns), *first.shape[1:]), first.dtype.newbyteorder("="))
    for place, column in enumerate(columns):
        table[:, place] = column
    return objects(table)


def lists(columns: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """One list per row."""
    return objects([list(values) for values in zip(*columns, strict=True)])


def decoded(data: bytes) -> str:
    """UTF-8 text, else `Malformed`."""
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise Malformed(f"a string is not UTF-8: {error.reason}") from error


def texts(whole: str, starts: Iterable[int], ends: Iterable[int]) -> NDArray[Any]:
    """UTF-8 texts out of bytes that were taken for Latin-1, which is right for ASCII as it is."""
    parts = [whole[start:end] for start, end in zip(starts, ends, strict=True)]
    if not all(map(str.isascii, parts)):
        parts = [part if part.isascii() else decoded(part.encode("latin-1")) for part in parts]
    return objects(parts)


def first_payload(rows: Rows) -> bytes:
    """The payload of the first row."""
    return bytes(rows.column(0, "u1", rows.length - PAYLOAD)[0])
