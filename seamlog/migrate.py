"""Old sessions are brought to today's form while they are read, by one small function per change.

Messages carry their own definitions and are mapped by field name, so a field that came later is
simply absent. What names cannot carry over (a renamed topic or field, another unit) is a step
here: a row of `STEPS` with the version that brought the change. A file says its version in the
metadata record `seamlog.recording`, key `format`; files from before that have version 1.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from seamlog.errors import SessionError
from seamlog.mcap.columns import Columns

FORMAT = 1
"""The version that is written today."""


class Step(NamedTuple):
    """Turns the columns of `topic` as they were before version `to` into those of `to`."""

    to: int
    topic: str
    change: Callable[[Columns], Columns]


STEPS: tuple[Step, ...] = ()


def format_of(recording: Mapping[str, str], where: str) -> int:
    """Version of a file by its recording metadata; `SessionError` if it is newer than we are."""
    text = recording.get("format", "1")
    if not text.isdigit() or int(text) > FORMAT:
        raise SessionError(
            f"{where} has format {text!r}; this seamlog reads up to format {FORMAT}: update it"
        )
    return int(text)


def migrated(topic: str, columns: Columns, version: int) -> Columns:
    """Columns of `topic`, read from a file of `version`, as they are today."""
    for step in STEPS:
        if step.to > version and step.topic == topic:
            columns = step.change(columns)
    return columns
