"""The column map: which column of a foreign file is which field of which topic.

    [time]
    column = "t"                    # or rate_hz = 100
    unit = "s"                      # s, ms, us, ns, min, h, d; datenum: days as MATLAB counts
    start = 2019-01-01T00:00:00Z    # what time 0 is; default 1970-01-01, right for unix time

    [channels."/table/encoder".fields]
    position_m = { column = "pos", unit = "mm" }
    velocity_m_s = { column = "v", scale = 0.5, offset = 1.0 }

    [channels."/table/command"]
    metadata = { unit = "V", force_per_unit = { column = "k" }, force_unit = "N" }
    fields.command = { column = "u" }
    fields.saturated = { constant = 0 }

A value is `column * scale + offset` in `unit`, then brought to the unit of the field. A channel may
have a `time` table of its own, and needs none where the file states the time of its columns. Fields
that no topic of the table has go under a topic `/import/...`, with names of one's own; they are
stored as they are, their units in the channel metadata.
"""

import difflib
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from seamlog.channels import CHANNELS, STAMP, Channel
from seamlog.channels import Field as ChannelField
from seamlog.errors import ConfigError, InputError

from .units import factor_between, spelled

TimeUnit = Literal["s", "ms", "us", "ns", "min", "h", "d", "datenum"]


EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
FREE = "/import/"
"""Topics that begin so have any fields."""
_FREE_FIELD = re.compile(r"[a-z][a-z0-9_]*")


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class TimeMap(_Model):
    """Where time comes from: a column, or an even rate."""

    column: str | None = None
    unit: TimeUnit = "s"
    rate_hz: float | None = Field(None, gt=0)
    start: datetime = EPOCH

    @model_validator(mode="after")
    def _one_source(self) -> "TimeMap":
        if (self.column is None) == (self.rate_hz is None):
            raise ValueError("give either column or rate_hz")
        if self.start.tzinfo is None:
            raise ValueError("start needs a time zone, such as 2019-01-01T00:00:00Z")
        return self


class FieldMap(_Model):
    """One field: a column with unit, scale and offset, or a constant."""

    column: str | None = None
    constant: float | None = None
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _one_source(self) -> "FieldMap":
        if (self.column is None) == (self.constant is None):
            raise ValueError("give either column or constant")
        return self


class ScalarColumn(_Model):
    """A metadata value that stands in the file as a single number."""

    column: str


class ChannelMap(_Model):
    """Fields and metadata of one topic."""

    time: TimeMap | None = None
    fields: dict[str, FieldMap] = Field(min_length=1)
    metadata: dict[str, str | ScalarColumn] = {}


class ColumnMap(_Model):
    """A whole map; `source` says where the data come from, for the session's metadata."""

    source: str = ""
    time: TimeMap | None = None
    channels: dict[str, ChannelMap] = Field(min_length=1)


def channel_of(topic: str, entry: ChannelMap) -> Channel:
    """The channel of the table, or the one that a free topic's fields make."""
    if topic in CHANNELS:
        return CHANNELS[topic]
    name = "".join(part.capitalize() for part in re.split(r"\W|_", topic.removeprefix(FREE)))
    fields = [
        ChannelField("float64", key, item.unit or "", "") for key, item in entry.fields.items()
    ]
    return Channel(topic, f"seamlog_msgs/msg/Import{name}", (STAMP, *fields), None, "imported")


def load_column_map(
    path: Path, columns: Collection[str], units: Mapping[str, str] | None = None
) -> ColumnMap:
    """Read a map and check it against the names in the file.

    `units` are those that the file states for its columns; they hold where the map gives none.

    Raises `ConfigError` with every fault at once, `InputError` if the map is not there.
    """
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such column map") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not valid TOML: {error}") from error
    _state_units(tree, units or {})
    faults = [*_name_faults(tree), *_column_faults(tree, columns)]
    try:
        found = ColumnMap.model_validate(tree)
    except ValidationError as error:
        faults = [*(_model_fault(item) for item in error.errors()), *faults]
    if faults:
        count = f"{len(faults)} fault{'s' if len(faults) > 1 else ''}"
        listed = "\n".join(f"  {fault}" for fault in faults)
        raise ConfigError(f"{path} has {count}:\n{listed}", tuple(faults))
    return found


def _state_units(tree: dict[str, Any], units: Mapping[str, str]) -> None:
    """Put the file's units where the map has none and changes nothing of the value."""
    for topic, name, value in _field_maps(tree):
        if not isinstance(value, dict) or "unit" in value or "scale" in value:
            continue
        unit = units.get(str(value.get("column")))
        free = topic.startswith(FREE)
        if unit and (free or _wants_unit(topic, name)):
            value["unit"] = unit if free else spelled(unit)


def _wants_unit(topic: str, name: str) -> bool:
    channel = CHANNELS.get(topic)
    fields = channel.fields if channel else ()
    return any(field.name == name and field.unit not in ("", "1") for field in fields)


def mappable(channel: Channel) -> list[str]:
    """Fields of a channel that a column can fill: plain numbers."""
    return [
        field.name
        for field in channel.fields
        if field is not STAMP and field.type not in ("string",) and not field.type.endswith("]")
    ]


def _model_fault(item: Any) -> str:
    path = ".".join(str(part) for part in item["loc"])
    message = item["msg"].removeprefix("Value error, ")
    return f"{path}: {message[:1].lower()}{message[1:]}"


def _field_maps(tree: dict[str, Any]) -> Iterator[tuple[str, str, Any]]:
    channels = tree.get("channels")
    for topic, entry in channels.items() if isinstance(channels, dict) else ():
        fields = entry.get("fields") if isinstance(entry, dict) else None
        for name, value in fields.items() if isinstance(fields, dict) else ():
            yield topic, name, value


def _name_faults(tree: dict[str, Any]) -> Iterator[str]:
    channels = tree.get("channels")
    own = [topic for topic, channel in CHANNELS.items() if channel.schema.startswith("seamlog")]
    for topic in channels if isinstance(channels, dict) else ():
        if topic not in own and not topic.startswith(FREE):
            yield f"channels.{topic}: no such topic{_hint(topic, own)}"
    for topic, name, value in _field_maps(tree):
        where = f"channels.{topic}.fields.{name}"
        if topic.startswith(FREE) and not _FREE_FIELD.fullmatch(name):
            yield f"{where}: a field name is lower-case letters, digits and _, a letter first"
        if topic not in own:
            continue
        known = mappable(CHANNELS[topic])
        if name not in known:
            yield f"{where}: no field a column can fill{_hint(name, known)}"
        elif isinstance(value, dict) and isinstance(value.get("unit"), str):
            yield from _unit_fault(where, value["unit"], CHANNELS[topic], name)


def _unit_fault(where: str, unit: str, channel: Channel, name: str) -> Iterator[str]:
    wanted = next(field.unit for field in channel.fields if field.name == name)
    if factor_between(spelled(unit), wanted) is None:
        yield f"{where}.unit: cannot turn {unit!r} into {wanted!r}; give scale instead"


def _column_faults(tree: dict[str, Any], columns: Collection[str]) -> Iterator[str]:
    time = tree.get("time")
    wanted = [("time.column", time.get("column"))] if isinstance(time, dict) else []
    wanted.extend(_time_columns(tree))
    for topic, name, value in _field_maps(tree):
        if isinstance(value, dict):
            wanted.append((f"channels.{topic}.fields.{name}.column", value.get("column")))
    wanted.extend(_metadata_columns(tree))
    for where, column in wanted:
        if isinstance(column, str) and column not in columns:
            yield f"{where}: the file has no column {column!r}{_hint(column, list(columns))}"


def _time_columns(tree: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    channels = tree.get("channels")
    for topic, entry in channels.items() if isinstance(channels, dict) else ():
        time = entry.get("time") if isinstance(entry, dict) else None
        if isinstance(time, dict):
            yield f"channels.{topic}.time.column", time.get("column")


def _metadata_columns(tree: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    channels = tree.get("channels")
    for topic, entry in channels.items() if isinstance(channels, dict) else ():
        metadata = entry.get("metadata") if isinstance(entry, dict) else None
        for key, value in metadata.items() if isinstance(metadata, dict) else ():
            if isinstance(value, dict):
                yield f"channels.{topic}.metadata.{key}.column", value.get("column")


def _hint(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, 1)
    if near:
        return f"; did you mean {near[0]!r}?"
    more = f" and {len(known) - 20} more" if len(known) > 20 else ""
    return f"; it has {', '.join(known[:20])}{more}"
