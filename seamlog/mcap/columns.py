"""Columns of one channel: field name to numpy array, built batch by batch."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import LimitExceeded
from seamlog.limits import Limits
from seamlog.mcap.cdr import Shape, learn, numpy_form
from seamlog.mcap.ros2msg import SEQUENCE, Node
from seamlog.mcap.rows import PAYLOAD, Batch, Rows

Columns = dict[str, NDArray[Any]]
LOG_TIME = "log_time_ns"
STAMP = "stamp_ns"
_MAX_SHAPES = 4096


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


def column_forms(nodes: tuple[Node, ...], prefix: str = "") -> dict[str, tuple[Any, int | None]]:
    """Column name to (dtype, length of a fixed array or None) of a message definition."""
    forms: dict[str, tuple[Any, int | None]] = {}
    for node in nodes:
        name = prefix + node.name
        if node.fields is not None and node.count is None:
            forms |= column_forms(node.fields, name + ".")
        elif node.fields is not None or node.base == "string" or node.count == SEQUENCE:
            forms[name] = (object, None)
        else:
            forms[name] = (numpy_form(node.base), node.count)
    return forms


class ChannelDecoder:
    """Decodes the CDR messages of one channel into the columns `names`."""

    def __init__(
        self, nodes: tuple[Node, ...], names: Iterable[str], limits: Limits, hint: int = 0
    ) -> None:
        forms = column_forms(nodes)
        self._nodes, self._limits = nodes, limits
        self._shapes: dict[int, list[Shape]] = {}
        self._columns = {name: GrowingColumn(*forms[name], hint) for name in names}
        self._log_times = GrowingColumn(np.int64, None, hint)

    def add(self, batch: Batch) -> None:
        """Decode a batch; `Malformed` if a message does not fit the definition."""
        rooms = {name: column.room(batch.count) for name, column in self._columns.items()}
        rooms[LOG_TIME] = self._log_times.room(batch.count)
        for rows, places in batch.groups:
            if rows.length - PAYLOAD > self._limits.message_bytes:
                raise LimitExceeded(
                    f"a message of {rows.length - PAYLOAD} bytes is larger than the limit "
                    f"message_bytes = {self._limits.message_bytes}"
                )
            self._add_rows(rows, places, rooms)

    def _add_rows(
        self, rows: Rows, places: NDArray[np.int64] | None, rooms: Mapping[str, NDArray[Any]]
    ) -> None:
        known = self._shapes.setdefault(rows.length, [])
        untried = iter(list(known))
        while rows.count:
            shape = next(untried, None)
            if shape is None:
                shape = learn(self._nodes, rows)
                self._remember(known, shape)
            same = shape.matches(rows)
            if same.all():
                _store(shape, rows, places, rooms)
                return
            if not same.any():
                continue
            at = np.arange(rows.count) if places is None else places
            _store(shape, rows.select(same), at[same], rooms)
            rows, places = rows.select(~same), at[~same]

    def _remember(self, known: list[Shape], shape: Shape) -> None:
        if sum(map(len, self._shapes.values())) >= _MAX_SHAPES:
            self._shapes.clear()
        known.append(shape)

    def columns(self) -> Columns:
        """What was decoded, `log_time_ns` first, in file order."""
        arrays = {LOG_TIME: self._log_times.array()}
        return arrays | {name: column.array() for name, column in self._columns.items()}


def _store(
    shape: Shape,
    rows: Rows,
    places: NDArray[np.int64] | None,
    rooms: Mapping[str, NDArray[Any]],
) -> None:
    where: Any = slice(None) if places is None else places
    rooms[LOG_TIME][where] = rows.log_times_ns()
    for leaf in shape.leaves:
        if leaf.name in rooms:
            rooms[leaf.name][where] = leaf.read(rows)


def by_log_time(columns: Columns) -> Columns:
    """Sorted by log time, ties in file order."""
    times = columns[LOG_TIME]
    if len(times) < 2 or (times[1:] >= times[:-1]).all():
        return columns
    order = np.argsort(times, kind="stable")
    return {name: column[order] for name, column in columns.items()}
