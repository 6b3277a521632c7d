"""From named columns and a column map to the messages of a session, and what was lost on the way.

Nothing is derived: a field that the map does not fill is NaN (false for flags) and is listed in
the channel metadata `absent`. Time must not go back from row to row; times that repeat, as coarse
clocks make them, are counted.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import STAMP, Channel, Field
from seamlog.errors import ImportFailed
from seamlog.evenness import evenness_of

from .column_map import (
    FREE,
    ChannelMap,
    ColumnMap,
    FieldMap,
    ScalarColumn,
    channel_of,
    mappable,
)
from .content import Content
from .loss import Loss
from .stamps import Columns, coarse_times, stamps_of, time_of
from .units import factor_between, spelled

_EMPTY = {"float64": np.nan, "float32": np.nan}


@dataclass(frozen=True)
class TopicColumns:
    """One topic, ready to be written."""

    columns: dict[str, NDArray[Any]]
    metadata: dict[str, str]
    channel: Channel


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
        stamp_ns = stamps_of(columns, time_of(topic, entry, mapping, times, path), entry, path)
        loss.rows = max(loss.rows, len(stamp_ns))
        loss.notes += coarse_times(columns, entry.time or mapping.time)
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
            loss.tell(topic, name, values[name])
        topics[topic] = TopicColumns(values, metadata, channel)
    return topics, loss


def _used(mapping: ColumnMap) -> set[str | None]:
    fields = [item for entry in mapping.channels.values() for item in entry.fields.values()]
    metadata = [value for entry in mapping.channels.values() for value in entry.metadata.values()]
    scalars = [value.column for value in metadata if isinstance(value, ScalarColumn)]
    maps = [mapping.time, *(entry.time for entry in mapping.channels.values())]
    times = [time.column for time in maps if time]
    return {*times, *(item.column for item in fields), *scalars}


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
