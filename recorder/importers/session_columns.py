"""The numeric columns of a session's topics, for column maps: `/topic.field`, `/topic.field[0]`."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import SeamlogError
from seamlog.session import Session

from .content import Content

_TIMES = ("stamp_ns", "log_time_ns")
_ELEMENTS = 32
"""More elements of a sequence than this are no axes but data."""


class SessionColumns(Mapping[str, NDArray[Any]]):
    """Columns by name; a topic is read when the first of its columns is asked for."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._names: dict[str, tuple[str, str]] = {}
        self.notes: list[str] = []
        for topic, row in session.info.channels.items():
            try:
                fields = [*self._fields(topic)]
            except SeamlogError as error:
                self.notes.append(_told(topic, row.count, error))
                continue
            self._names |= {f"{topic}.{field}": (topic, field) for field in fields}

    def _fields(self, topic: str) -> Iterator[str]:
        for name, column in self._session.columns(topic).items():
            if column.dtype.kind in "biuf" and column.ndim == 1:
                yield name
            elif column.dtype == object and len(column) and isinstance(column[0], np.ndarray):
                longest = max(len(values) for values in column)
                if column[0].dtype.kind in "biuf" and column[0].ndim == 1 and longest <= _ELEMENTS:
                    yield from (_picked(name, place) for place in range(longest))

    def __getitem__(self, name: str) -> NDArray[Any]:
        topic, field = self._names[name]
        column: NDArray[Any] = self._session.columns(topic, [field])[field]
        return column

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def times(self) -> dict[str, str]:
        """The time column of each other column: the stamps where there are any."""
        found = {}
        for name, (topic, field) in self._names.items():
            if field not in _TIMES:
                stamp = f"{topic}.stamp_ns"
                found[name] = stamp if stamp in self._names else f"{topic}.log_time_ns"
        return found


def _picked(name: str, place: int) -> str:
    """`joints.x` and 0 give `joints[0].x`; `position` and 0 give `position[0]`."""
    head, dot, tail = name.rpartition(".")
    return f"{head}[{place}].{tail}" if dot else f"{name}[{place}]"


def content_of_session(session: Session) -> Content:
    """All numeric columns of a session's topics."""
    columns = SessionColumns(session)
    return Content(columns, times=columns.times(), notes=columns.notes)


def unreadable(session: Session) -> Iterator[str]:
    """Topics whose first messages cannot be read as columns, with the reason."""
    for topic, row in session.info.channels.items():
        if not row.count:
            continue
        first = session.info.start_ns if row.start_ns is None else row.start_ns
        try:
            session.window(first, first + 1).columns(topic)
        except SeamlogError as error:
            yield _told(topic, row.count, error)


def _told(topic: str, count: int, error: SeamlogError) -> str:
    reason = str(error).partition(f"{topic}: ")[2] or str(error)
    return f"{topic}: its {count} messages were copied but cannot be read: {reason}"
