"""From named columns and a column map to the messages of a session, and what was lost on the way.

Nothing is derived: a field that the map does not fill is NaN (false for flags) and is listed in
the channel metadata `absent`. Time must not go back from row to row; times that repeat, as coarse
clocks make them, are counted.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import STAMP, Channel, Field
from seamlog.errors import ImportFailed
from seamlog.evenness import Evenness, evenness_of

from .column_map import (
    FREE,
    ChannelMap,
    ColumnMap,
    FieldMap,
    ScalarColumn,
    TimeMap,
    channel_of,
    mappable,
)
from .content import Content
from .units import factor_between, spelled

Columns = Mapping[str, NDArray[Any]]
_NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0, "min": 60e9, "h": 3600e9, "d": 86400e9}
_NS["datenum"] = _NS["d"]
_DATENUM_OF_1970 = 719_529
_LAST_NS = (1 << 63) - 1
_COARSE_NS = 100.0
_LONGEST_TABLE_M = 20.0
_EMPTY = {"float64": np.nan, "float32": np.nan}


@dataclass(frozen=True)
class TopicColumns:
    """One topic, ready to be written."""

    columns: dict[str, NDArray[Any]]
    metadata: dict[str, str]
    channel: Channel


@dataclass
class Loss:
    """What an import took over and what it left: names by topic, counts of missing values."""

    rows: int
    not_imported: list[str]
    absent: dict[str, list[str]] = field(default_factory=dict)
    missing_values: dict[str, int] = field(default_factory=dict)
    timing: dict[str, Evenness] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)


def convert(
    content: Content, mapping: ColumnMap, path: Path
) -> tuple[dict[str, TopicColumns], Loss]:
    """Topics with their columns, `stamp_ns` among them, and the loss report.

    Lost is what the file has of the columns that the map asks for and could not be read. `path`
    names the file in errors (`ImportFailed`).
    """
    columns, times = content.columns, content.times
    used = _used(mapping)
    stated = set(times.values())
    loss = Loss(0, sorted(name for name in columns if name not in used | stated))
    loss.notes = [*content.notes]
    loss.losses = [*content.losses]
    loss.losses += [text for name, text in content.lost_cells.items() if name in used]
    topics = {}
    for topic, entry in mapping.channels.items():
        channel = channel_of(topic, entry)
        stamp_ns = _stamps(columns, _time_of(topic, entry, mapping, times, path), entry, path)
        loss.rows = max(loss.rows, len(stamp_ns))
        loss.notes += _coarse(columns, entry.time or mapping.time)
        timing = evenness_of(stamp_ns)
        if timing:
            loss.timing[topic] = timing
        values = _fields(columns, channel, entry, stamp_ns, path)
        metadata = {key: _text(columns, key, value, path) for key, value in entry.metadata.items()}
        if topic.startswith(FREE):
            units = {field.name: field.unit for field in channel.fields[1:] if field.unit}
            metadata = {"units": json.dumps(units, sort_keys=True)} | metadata
        absent = [name for name in mappable(channel) if name not in entry.fields]
        if absent:
            loss.absent[topic] = absent
            metadata["absent"] = ",".join(absent)
        for name in entry.fields:
            missing = int(np.isnan(values[name].astype(np.float64)).sum())
            if missing:
                loss.missing_values[f"{topic} {name}"] = missing
            span = _span_m(topic, name, values[name])
            if span > _LONGEST_TABLE_M:
                loss.notes.append(f"{topic} {name} spans {span:.4g} m: is its unit right?")
            digits = _rounded(values[name])
            if digits:
                loss.notes.append(f"{topic} {name} has {digits} significant digits")
        topics[topic] = TopicColumns(values, metadata, channel)
    return topics, loss


def _span_m(topic: str, name: str, values: NDArray[Any]) -> float:
    """How far a position of the table goes; 0 for everything else."""
    if topic.startswith(FREE) or name != "position_m" or np.isnan(values).all():
        return 0.0
    return float(np.nanmax(values) - np.nanmin(values))


def _used(mapping: ColumnMap) -> set[str | None]:
    fields = [item for entry in mapping.channels.values() for item in entry.fields.values()]
    metadata = [value for entry in mapping.channels.values() for value in entry.metadata.values()]
    scalars = [value.column for value in metadata if isinstance(value, ScalarColumn)]
    maps = [mapping.time, *(entry.time for entry in mapping.channels.values())]
    times = [time.column for time in maps if time]
    return {*times, *(item.column for item in fields), *scalars}


def _rounded(values: NDArray[Any]) -> int | None:
    """Significant digits of values that are rounded to four or fewer; None for others."""
    found = (
        np.unique(values[np.isfinite(values) & (values != 0)]) if values.ndim == 1 else values[:0]
    )
    if len(found) < 50:
        return None
    scale = 10.0 ** np.floor(np.log10(np.abs(found)))
    for digits in (2, 3, 4):
        step = 10.0 ** (digits - 1)
        if np.allclose(np.rint(found / scale * step) / step * scale, found, rtol=1e-9, atol=0):
            return digits
    return None


def _time_of(
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


def _coarse(columns: Columns, time: TimeMap | None) -> list[str]:
    """A note where float64 holds the times more coarsely than in ns."""
    if time is None or time.column is None or columns[time.column].dtype.kind != "f":
        return []
    step_ns = float(np.spacing(np.abs(columns[time.column]).max())) * _NS[time.unit]
    if step_ns < _COARSE_NS:
        return []
    return [f"time column {time.column!r}: float64 holds such times in steps of {step_ns:.2g} ns"]


def _stamps(columns: Columns, time: TimeMap, entry: ChannelMap, path: Path) -> NDArray[np.int64]:
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


def _fields(
    columns: Columns,
    channel: Channel,
    entry: ChannelMap,
    stamp_ns: NDArray[np.int64],
    path: Path,
) -> dict[str, NDArray[Any]]:
    values: dict[str, NDArray[Any]] = {"stamp_ns": stamp_ns}
    for item in channel.fields:
        if item is STAMP:
            continue
        mapped = entry.fields.get(item.name)
        if mapped is None:
            values[item.name] = _empty(item, len(stamp_ns))
        else:
            values[item.name] = _typed(
                item, _values(columns, item, mapped, len(stamp_ns), path), path
            )
    return values


def _empty(item: Field, rows: int) -> NDArray[Any]:
    if item.type == "string":
        return np.full(rows, "", dtype=object)
    if item.type.endswith("[]"):
        return np.array([np.empty(0)] * rows, dtype=object)
    if item.type.endswith("]"):
        length = int(item.type.partition("[")[2][:-1])
        return np.full((rows, length), np.nan)
    return np.full(rows, _EMPTY.get(item.type, 0), dtype=_dtype(item))


def _values(
    columns: Columns, item: Field, mapped: FieldMap, rows: int, path: Path
) -> NDArray[np.float64]:
    if mapped.constant is not None:
        raw = np.full(rows, mapped.constant)
    else:
        assert mapped.column is not None
        found = np.asarray(columns[mapped.column])
        if found.dtype.kind not in "iufb":
            raise ImportFailed(f"{path}: column {mapped.column!r} holds no numbers")
        raw = found.astype(np.float64)
    if raw.shape != (rows,):
        raise ImportFailed(
            f"{path}: column {mapped.column!r} has {raw.size} values, time has {rows}; "
            "map columns of one length into one session"
        )
    factor = 1.0 if mapped.unit is None else factor_between(spelled(mapped.unit), item.unit)
    if factor is None and item.unit == mapped.unit:
        factor = 1.0
    assert factor is not None
    return (raw * mapped.scale + mapped.offset) * factor


def _typed(item: Field, values: NDArray[np.float64], path: Path) -> NDArray[Any]:
    if item.type.startswith("float"):
        return values.astype(_dtype(item))
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise ImportFailed(
            f"{path}: row {bad[0] + 1} has no value for {item.name}, which is a {item.type} and "
            "cannot be missing; leave the field out of the map"
        )
    if item.type == "bool":
        is_set: NDArray[np.bool_] = values != 0
        return is_set
    kept: NDArray[Any] = values.astype(_dtype(item))
    bad = np.flatnonzero(kept != values)
    if len(bad):
        raise ImportFailed(
            f"{path}: row {bad[0] + 1} has {values[bad[0]]:g} for {item.name}, which is a "
            f"{item.type} and cannot hold it; correct scale and offset, or leave the field out"
        )
    return kept


def _dtype(item: Field) -> str:
    return "bool" if item.type == "bool" else item.type


def _text(columns: Columns, key: str, value: str | ScalarColumn, path: Path) -> str:
    if isinstance(value, str):
        return value
    found = columns[value.column]
    if found.ndim:
        raise ImportFailed(
            f"{path}: metadata {key} asks for {value.column!r}, a column of {found.size} values; "
            "it must be a single number"
        )
    return repr(float(found))
