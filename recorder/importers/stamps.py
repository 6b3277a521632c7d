"""When the rows of a topic were: from a column of times, or from an even rate."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ImportFailed

from .column_map import ChannelMap, ColumnMap, TimeMap

Columns = Mapping[str, NDArray[Any]]
_NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0, "min": 60e9, "h": 3600e9, "d": 86400e9}
_NS["datenum"] = _NS["d"]
_DATENUM_OF_1970 = 719_529
_LAST_NS = (1 << 63) - 1
_COARSE_NS = 100.0


def time_of(
    topic: str, entry: ChannelMap, mapping: ColumnMap, times: Mapping[str, str], path: Path
) -> TimeMap:
    given = entry.time or mapping.time
    if given is not None:
        return given
    named = [item.column for item in entry.fields.values() if item.column]
    stated = {times[name] for name in named if name in times}
    if len(stated) == 1:
        return TimeMap(column=stated.pop(), unit="ns")
    if stated:
        raise ImportFailed(
            f"{path}: the columns of {topic} have different times ({', '.join(sorted(stated))}); "
            "map them to topics of their own, or give time.column"
        )
    raise ImportFailed(
        f"{path}: nothing says when the rows of {topic} were: the file has no time for them; give "
        "[time] with column, or with rate_hz and start"
    )


def coarse_times(columns: Columns, time: TimeMap | None) -> list[str]:
    """A note where float64 holds the times more coarsely than in ns."""
    if time is None or time.column is None or columns[time.column].dtype.kind != "f":
        return []
    step_ns = float(np.spacing(np.abs(columns[time.column]).max())) * _NS[time.unit]
    if step_ns < _COARSE_NS:
        return []
    return [f"time column {time.column!r}: float64 holds such times in steps of {step_ns:.2g} ns"]


def stamps_of(columns: Columns, time: TimeMap, entry: ChannelMap, path: Path) -> NDArray[np.int64]:
    since = time.start - datetime(1970, 1, 1, tzinfo=UTC)
    start_ns = (since.days * 86400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000
    if time.column is None:
        return start_ns + _even_ns(time, _row_count(columns, entry, path))
    values = np.asarray(columns[time.column])
    if values.ndim != 1 or not len(values):
        raise ImportFailed(f"{path}: time column {time.column!r} is no column but a single number")
    if values.dtype.kind not in "iuf":
        raise ImportFailed(f"{path}: time column {time.column!r} holds no numbers")
    if time.unit == "datenum":
        values = values - _DATENUM_OF_1970
    seconds = values.astype(np.float64)
    bad = np.flatnonzero(~np.isfinite(seconds))
    if len(bad):
        raise ImportFailed(
            f"{path}: time column {time.column!r} has no value in row {bad[0] + 1}; "
            "remove such rows or map time by rate_hz"
        )
    if np.abs(seconds).max() * _NS[time.unit] + start_ns > _LAST_NS:
        raise ImportFailed(
            f"{path}: time column {time.column!r} reaches {np.abs(seconds).max():g} {time.unit}, "
            "which is no time between 1970 and 2262; check its unit"
        )
    exact = values.dtype.kind in "iu"
    scaled = values * int(_NS[time.unit]) if exact else np.rint(seconds * _NS[time.unit])
    stamp_ns = start_ns + scaled.astype(np.int64)
    _require_increasing(stamp_ns, time.column, path)
    return stamp_ns


def _require_increasing(stamp_ns: NDArray[np.int64], column: str, path: Path) -> None:
    steps = np.diff(stamp_ns)
    back = np.flatnonzero(steps < 0)
    if not len(back) and (steps == 0).sum() * 2 > len(steps):
        back = np.flatnonzero(steps == 0)
    if len(back):
        row = int(back[0]) + 2
        raise ImportFailed(
            f"{path}: time column {column!r} does not increase in row {row} "
            f"({len(back)} such row{'s' if len(back) > 1 else ''}); sort or clean the file, "
            "or map time by rate_hz"
        )
    if int(stamp_ns[0]) < 0:
        raise ImportFailed(f"{path}: time column {column!r} begins before 1970; give time.start")


def _even_ns(time: TimeMap, rows: int) -> NDArray[np.int64]:
    assert time.rate_hz is not None
    stamp_ns: NDArray[np.int64] = np.rint(np.arange(rows) * (1e9 / time.rate_hz)).astype(np.int64)
    return stamp_ns


def _row_count(columns: Columns, entry: ChannelMap, path: Path) -> int:
    for item in entry.fields.values():
        if item.column is not None and columns[item.column].ndim == 1:
            return len(columns[item.column])
    raise ImportFailed(f"{path}: the map names no column with rows, only constants")
