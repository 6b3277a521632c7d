"""Columns of one channel: field name to numpy array, built batch by batch."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import LimitExceeded
from seamlog.limits import Limits
from seamlog.mcap.rows import PAYLOAD, Batch, Rows
from seamlog.mcap.shapes import Forms, Grammar, NoShape, Shape

Columns = dict[str, NDArray[Any]]
LOG_TIME = "log_time_ns"
STAMP = "stamp_ns"
_ELEMENT = re.compile(r"(?P<head>[^\[\]]+)\[(?P<place>\d{1,9})\](?P<tail>(\.[^\[\]]+)?)")
_MANY_SHAPES, _MOST_SHAPES = 64, 4096
_ROWS_PER_SHAPE = 32
"""Learning a shape costs about as much as decoding this many messages of any shape."""


class GrowingColumn:
    """One column, grown in place; `width` is the length of a fixed array, None for a value."""

    def __init__(self, form: str | type, width: int | None, hint: int) -> None:
        self._tail = () if width is None else (width,)
        self._data: NDArray[Any] = np.empty((max(hint, 1), *self._tail), form)
        self._size = 0

    def room(self, count: int) -> NDArray[Any]:
        """`count` more rows, to be filled by the caller."""
        start, self._size = self._size, self._size + count
        if self._size > len(self._data):
            grown = np.empty((max(self._size, 2 * len(self._data)), *self._tail), self._data.dtype)
            grown[:start] = self._data[:start]
            self._data = grown
        return self._data[start : self._size]

    def array(self) -> NDArray[Any]:
        """Everything so far."""
        return self._data[: self._size]


def check_size(length: int, limits: Limits) -> None:
    """Raise `LimitExceeded` if records of `length` bytes hold too large a message."""
    if length - PAYLOAD > limits.message_bytes:
        raise LimitExceeded(
            f"a message of {length - PAYLOAD} bytes is larger than the limit "
            f"message_bytes = {limits.message_bytes}"
        )


@dataclass(frozen=True, slots=True)
class Wish:
    """A column that is asked for: a field, or one element of a field that holds sequences."""

    name: str
    field: str
    place: int | None = None


def wish(name: str, forms: Forms) -> Wish | None:
    """What `name` (`position` or `position[0]`, `joints[0].x`) asks for; None if unknown."""
    if name in forms:
        return Wish(name, name)
    match = _ELEMENT.fullmatch(name)
    if match is None:
        return None
    field = match["head"] + match["tail"]
    if field not in forms or forms[field].element is None:
        return None
    return Wish(name, field, int(match["place"]))


def _form(wished: Wish, forms: Forms) -> tuple[Any, int | None]:
    """Numbers out of sequences are float64, so that NaN can stand where one is too short."""
    form = forms[wished.field]
    if wished.place is None:
        return form.dtype, form.count
    return (object if form.element is object else np.float64), None


class ChannelDecoder:
    """Decodes the messages of one channel into the columns that are wished for."""

    def __init__(
        self, grammar: Grammar, wishes: Sequence[Wish], limits: Limits, hint: int = 0
    ) -> None:
        self._grammar, self._limits, self._wishes = grammar, limits, wishes
        self._shapes: dict[int, list[Shape]] = {}
        self._learned = self._seen = 0
        self._columns = {
            wished.name: GrowingColumn(*_form(wished, grammar.forms), hint) for wished in wishes
        }
        self._log_times = GrowingColumn(np.int64, None, hint)

    def add(self, batch: Batch) -> None:
        """Decode a batch; `Malformed` if a message does not fit the definition."""
        rooms = {name: column.room(batch.count) for name, column in self._columns.items()}
        rooms[LOG_TIME] = self._log_times.room(batch.count)
        for rows, places in batch.groups():
            check_size(rows.length, self._limits)
            if not self._add_rows(rows, places, rooms):
                self._decode_all(batch, rooms)
                return

    @property
    def _is_varied(self) -> bool:
        few = self._learned * _ROWS_PER_SHAPE > self._seen
        return self._learned > _MANY_SHAPES and (few or self._learned > _MOST_SHAPES)

    def _add_rows(
        self, rows: Rows, places: NDArray[np.int64] | None, rooms: Mapping[str, NDArray[Any]]
    ) -> bool:
        """Store rows by their shapes; False once there are too many shapes for that."""
        known = self._shapes.setdefault(rows.length, [])
        untried = iter(list(known))
        while rows.count:
            shape = next(untried, None)
            if shape is None:
                if self._is_varied:
                    return False
                try:
                    shape = self._grammar.learn(rows)
                except NoShape:
                    return False
                known.append(shape)
                self._learned += 1
            same = shape.matches(rows)
            if same.all():
                self._store(shape, rows, places, rooms)
                return True
            if not same.any():
                continue
            at = np.arange(rows.count) if places is None else places
            self._store(shape, rows.select(same), at[same], rooms)
            rows, places = rows.select(~same), at[~same]
        return True

    def _store(
        self,
        shape: Shape,
        rows: Rows,
        places: NDArray[np.int64] | None,
        rooms: Mapping[str, NDArray[Any]],
    ) -> None:
        self._seen += rows.count
        _put(rooms[LOG_TIME], places, rows.log_times_ns())
        leaves = {leaf.name: leaf for leaf in shape.leaves}
        for wished in self._wishes:
            leaf, room = leaves[wished.field], rooms[wished.name]
            if wished.place is None:
                _put(room, places, leaf.read(rows))
            elif leaf.element is not None and wished.place < leaf.count:
                _put(room, places, leaf.element(wished.place)(rows))
            else:
                room[slice(None) if places is None else places] = _missing(room)

    def _decode_all(self, batch: Batch, rooms: Mapping[str, NDArray[Any]]) -> None:
        self._shapes.clear()
        rooms[LOG_TIME][:] = batch.log_times_ns()
        found = self._grammar.decode(batch, [wished.field for wished in self._wishes])
        for wished in self._wishes:
            column, room, place = found[wished.field], rooms[wished.name], wished.place
            if place is None:
                room[:] = column
                continue
            lacking = _missing(room)
            room[:] = [values[place] if place < len(values) else lacking for values in column]

    def columns(self) -> Columns:
        """What was decoded, `log_time_ns` first, in file order."""
        arrays = {LOG_TIME: self._log_times.array()}
        return arrays | {name: column.array() for name, column in self._columns.items()}


def _put(room: NDArray[Any], places: NDArray[np.int64] | None, values: NDArray[Any]) -> None:
    """Values of a batch into their places; numpy scatters what is contiguous twice as fast."""
    if places is None:
        room[:] = values
    else:
        room[places] = np.ascontiguousarray(values)


def _missing(room: NDArray[Any]) -> Any:
    return None if room.dtype == object else np.nan


def is_in_order(columns: Columns) -> bool:
    """Whether log times never fall back."""
    times = columns[LOG_TIME]
    return bool((times[1:] >= times[:-1]).all())


def by_log_time(columns: Columns) -> Columns:
    """Sorted by log time, ties in file order."""
    if is_in_order(columns):
        return columns
    order = np.argsort(columns[LOG_TIME], kind="stable")
    return {name: column[order] for name, column in columns.items()}
