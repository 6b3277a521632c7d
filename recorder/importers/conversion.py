"""From named columns and a column map to the messages of a session, and what was lost on the way.

Nothing is derived: a field that the map does not fill is NaN (false for flags) and is listed in
the channel metadata `absent`. Time must increase from row to row.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import CHANNELS, STAMP, Channel, Field
from seamlog.errors import ImportFailed

from .column_map import ChannelMap, ColumnMap, FieldMap, ScalarColumn, TimeMap, mappable
from .units import factor_between

Columns = Mapping[str, NDArray[Any]]
_NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0, "min": 60e9}
_EMPTY = {"float64": np.nan, "float32": np.nan}


@dataclass(frozen=True)
class TopicColumns:
    """One topic, ready to be written."""

    columns: dict[str, NDArray[Any]]
    metadata: dict[str, str]


@dataclass
class Loss:
    """What an import took over and what it left: names by topic, counts of missing values."""

    rows: int
    not_imported: list[str]
    absent: dict[str, list[str]] = field(default_factory=dict)
    missing_values: dict[str, int] = field(default_factory=dict)

    @property
    def any(self) -> bool:
        """Whether anything of the file, or of the topics, is missing in the session."""
        return bool(self.not_imported or self.absent or self.missing_values)


def convert(
    columns: Columns, mapping: ColumnMap, path: Path
) -> tuple[dict[str, TopicColumns], Loss]:
    """Topics with their columns, `stamp_ns` among them, and the loss report.

    `path` names the file in errors (`ImportFailed`).
    """
    stamp_ns = _stamps(columns, mapping, path)
    used = _used(mapping)
    loss = Loss(len(stamp_ns), sorted(name for name in columns if name not in used))
    topics = {}
    for topic, entry in mapping.channels.items():
        channel = CHANNELS[topic]
        values = _fields(columns, channel, entry, stamp_ns, path)
        metadata = {key: _text(columns, key, value, path) for key, value in entry.metadata.items()}
        absent = [name for name in mappable(channel) if name not in entry.fields]
        if absent:
            loss.absent[topic] = absent
            metadata["absent"] = ",".join(absent)
        for name in entry.fields:
            missing = int(np.isnan(values[name].astype(np.float64)).sum())
            if missing:
                loss.missing_values[f"{topic} {name}"] = missing
        topics[topic] = TopicColumns(values, metadata)
    return topics, loss


def _used(mapping: ColumnMap) -> set[str | None]:
    fields = [item for entry in mapping.channels.values() for item in entry.fields.values()]
    metadata = [value for entry in mapping.channels.values() for value in entry.metadata.values()]
    scalars = [value.column for value in metadata if isinstance(value, ScalarColumn)]
    return {mapping.time.column, *(item.column for item in fields), *scalars}


def _stamps(columns: Columns, mapping: ColumnMap, path: Path) -> NDArray[np.int64]:
    time = mapping.time
    since = time.start - datetime(1970, 1, 1, tzinfo=UTC)
    start_ns = (since.days * 86400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000
    if time.column is None:
        return start_ns + _even_ns(time, _row_count(columns, mapping, path))
    values = np.asarray(columns[time.column])
    if values.ndim != 1 or not len(values):
        raise ImportFailed(f"{path}: time column {time.column!r} is no column but a single number")
    seconds = values.astype(np.float64)
    bad = np.flatnonzero(~np.isfinite(seconds))
    if len(bad):
        raise ImportFailed(
            f"{path}: time column {time.column!r} has no value in row {bad[0] + 1}; "
            "remove such rows or map time by rate_hz"
        )
    stamp_ns = start_ns + np.rint(seconds * _NS[time.unit]).astype(np.int64)
    _require_increasing(stamp_ns, time.column, path)
    return stamp_ns


def _require_increasing(stamp_ns: NDArray[np.int64], column: str, path: Path) -> None:
    back = np.flatnonzero(np.diff(stamp_ns) <= 0)
    if len(back):
        row = int(back[0]) + 2
        raise ImportFailed(
            f"{path}: time column {column!r} does not increase in row {row} "
            f"({len(back)} such row{'s' if len(back) > 1 else ''}); sort or clean the file, "
            "or map time by rate_hz"
        )


def _even_ns(time: TimeMap, rows: int) -> NDArray[np.int64]:
    assert time.rate_hz is not None
    stamp_ns: NDArray[np.int64] = np.rint(np.arange(rows) * (1e9 / time.rate_hz)).astype(np.int64)
    return stamp_ns


def _row_count(columns: Columns, mapping: ColumnMap, path: Path) -> int:
    for entry in mapping.channels.values():
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
        raw = np.asarray(columns[mapped.column], dtype=np.float64)
    if raw.shape != (rows,):
        raise ImportFailed(
            f"{path}: column {mapped.column!r} has {raw.size} values, time has {rows}; "
            "map columns of one length into one session"
        )
    factor = 1.0 if mapped.unit is None else factor_between(mapped.unit, item.unit)
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
    return (values != 0) if item.type == "bool" else values.astype(_dtype(item))


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
