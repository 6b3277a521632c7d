"""Proposes a column map for a file, and says what was guessed."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import CHANNELS
from seamlog.errors import ImportFailed

from .content import Content
from .units import TIMES, factor_between, is_unit, spelled

_ACTUAL = r"(act|actual|meas|encoder|enc|ist|feedback|pos$|position$)"
_WANTED = r"(com+and|cmd|ref|reference|set|soll|target|desired|des)"
_RULES = (
    ("/table/reference", "position_m", rf"{_WANTED}.*(pos|weg)|(pos|weg).*{_WANTED}|^qg$"),
    ("/table/reference", "velocity_m_s", rf"{_WANTED}.*(vel|speed)|(vel|speed).*{_WANTED}"),
    ("/table/reference", "acceleration_m_s2", rf"{_WANTED}.*acc|acc.*{_WANTED}"),
    (
        "/table/encoder",
        "position_m",
        r"(act|enc|meas|ist|table).*pos|^x?_?pos(ition)?|^qm$|^weg|encoder",
    ),
    ("/table/encoder", "velocity_m_s", r"(act|enc|meas|ist|table).*(vel|speed)|^x?_?vel(ocity)?"),
    (
        "/table/command",
        "command",
        r"^vir$|^u$|torque|control|(motor|drive|servo|output).*(curr|volt|com)|^command$",
    ),
    ("/weld/process", "current_a", r"(weld|arc|strom).*curr|^curr|(^|_)amp|strom|_i$|^i$"),
    ("/weld/process", "voltage_v", r"(weld|arc).*volt|^volt|spannung|^v$|_u$"),
    ("/weld/process", "wire_feedrate_m_min", r"wire|wfs|draht|feed_?rate"),
)
_TIME = re.compile(
    r"^(t|time|x_value|x_axis|timestamp|time_?stamp|zeit|datum|date|datetime|elapsed|seconds|sec|ms|us|unix.*)\b|time$|_t$",
    re.I,
)
_UNIT_AT_END = re.compile(
    r"[_ .](mm_s2|mm_s|m_s2|m_s|mm|um|m|ma|ka|a|mv|v|ns|us|ms|s|m_min|mm_min)$", re.I
)


def guess(content: Content, path: Path) -> str:
    """A column map as TOML; comments say what was guessed and what must be looked at."""
    columns = {name: column for name, column in content.columns.items() if column.ndim == 1}
    time = _time_column(columns, content)
    lines = [f"# Proposed for {path.name}. Look at each line before you use it."]
    lines += _time_lines(time, columns, content)
    left = [name for name in columns if name != time and name not in content.times.values()]
    rows = len(columns[time]) if time is not None else 0
    odd = [name for name in left if rows and len(columns[name]) != rows]
    left = [name for name in left if name not in odd]
    if not left:
        why = [f"{path} has no column of numbers that goes with its time {time!r}", *content.notes]
        raise ImportFailed("; ".join(why))
    taken: dict[tuple[str, str], list[str]] = {}
    for topic, field, pattern in _RULES:
        found = [name for name in left if re.search(pattern, _bare(name), re.I)]
        found = [name for name in found if _fits(name, topic, field, content)]
        if found:
            taken[topic, field] = found
            left.remove(found[0])
    for topic in dict.fromkeys(topic for topic, _ in taken):
        lines += ["", f'[channels."{topic}".fields]']
        for (owner, field), found in taken.items():
            if owner == topic:
                lines += _field_lines(field, found, topic, content)
    lines += _free_lines(left, columns, content, path)
    lines += [f"# {name}: {len(columns[name])} values, {rows} times, not mapped" for name in odd]
    return "\n".join(lines) + "\n"


def _bare(name: str) -> str:
    """The name without group, unit and case, words joined by _."""
    tail = re.sub(r"[\[(].*?[\])]", "", _without_unit(name)).rpartition("/")[2]
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|[\s.\-]+", "_", tail).strip("_").lower()


def _without_unit(name: str) -> str:
    """`Weg` of `Weg / mm` and `Weg [m/min]`; groups have no blanks around their slash.

    Places of elements stay: `q[0]` is `q_0`.
    """
    name = re.sub(r"\[(\d+)\]", r"_\1", name)
    return re.sub(r"(\s+[/,]\s*|,\s*| in )[^\s,]+$|\s*[\[(][^\[\]()]*[\])]\s*$", "", name)


def _time_column(columns: Mapping[str, NDArray[Any]], content: Content) -> str | None:
    rising = [name for name, column in columns.items() if _rises(column)]
    named = [
        name for name in rising if _TIME.search(_bare(name)) and name not in content.times.values()
    ]
    if named:
        return named[0]
    if content.times:
        return None
    in_time = [name for name in rising if spelled(content.units.get(name, "")) in TIMES]
    unix = [name for name in rising if 9e8 < float(columns[name].flat[0]) < 3e18]
    return next(iter([*in_time, *unix]), None)


def _rises(column: NDArray[Any]) -> bool:
    values = column.astype(np.float64)
    return (
        len(values) > 2
        and bool(np.isfinite(values).all())
        and bool((np.diff(values) >= 0).all())
        and bool(values[-1] > values[0])
    )


def _time_lines(
    time: str | None, columns: Mapping[str, NDArray[Any]], content: Content
) -> list[str]:
    if time is None and content.times:
        return ["# The file states the time of its columns."]
    if time is None:
        return [
            "",
            "[time]",
            "# No column of time was found: say how many rows there are per second.",
            "rate_hz = 0",
        ]
    first = float(columns[time].flat[0])
    step = float(np.median(np.diff(columns[time].astype(np.float64))))
    unit, why = _time_unit(time, first, step, content)
    lines = ["", "[time]", f"column = {_quoted(time)}", f'unit = "{unit}"  # {why}']
    if unit == "datenum":
        return lines
    for epoch, (unit_of_epoch, low, high, who) in _EPOCHS.items():
        if unit == unit_of_epoch and low <= first < high:
            return [*lines, f"start = {epoch}T00:00:00Z  # guessed: as {who} count"]
    if first < 0:
        lines.append("start = 1970-01-02T00:00:00Z  # times begin before 0: say when 0 was")
    elif first * _SECONDS[unit] < 9e8:
        lines.append("start = 1970-01-01T00:00:00Z  # the file does not say when it began")
    return lines


_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
_EPOCHS = {
    "1899-12-30": ("d", 2e4, 8e4, "spreadsheets"),
    "1904-01-01": ("s", 3.4e9, 4.3e9, "LabVIEW"),
}
"""What time 0 is, told by unit and size of the first value."""
_DAY_NAME = re.compile(r"dat(e|um)|day|excel|serial", re.I)


def _time_unit(name: str, first: float, step: float, content: Content) -> tuple[str, str]:
    stated = spelled(content.units.get(name, ""))
    if stated in TIMES:
        return stated, "as the file says"
    match = _UNIT_AT_END.search(name)
    if match and match[1].lower() in TIMES:
        return match[1].lower(), "guessed from the name"
    for unit, bound in (("ns", 9e17), ("us", 9e14), ("ms", 9e11), ("s", 9e8)):
        if first >= bound:
            return unit, "guessed: then it is a time since 1970"
    if 7e5 <= first < 8e5 and step < 1:
        return "datenum", "guessed: days as MATLAB counts, CHECK"
    if 2e4 <= first < 8e4 and step < 1 and _DAY_NAME.search(name):
        return "d", "guessed: days as spreadsheets count, CHECK"
    if step >= 1 and float(step).is_integer():
        return "ms", "guessed from whole steps: CHECK"
    return "s", "guessed: CHECK"


def _unit_of(name: str, wanted: str, content: Content) -> tuple[str | None, str]:
    stated = spelled(content.units.get(name, ""))
    if is_unit(stated) and factor_between(stated, wanted) is not None:
        return stated, "unit as the file says"
    match = _UNIT_AT_END.search(name)
    if match:
        text = match[1].lower()
        unit = {"ma": "mA", "ka": "kA", "a": "A", "mv": "mV", "v": "V"}.get(text)
        unit = unit or text.replace("_min", "/min").replace("_s2", "/s^2").replace("_s", "/s")
        if factor_between(unit, wanted) is not None:
            return unit, "unit guessed from the name"
    if stated:
        return None, f"the file's unit {stated!r} is not known: give scale or unit"
    return None, f"no unit found: taken as {wanted}, CHECK"


def _fits(name: str, topic: str, field: str, content: Content) -> bool:
    stated = spelled(content.units.get(name, ""))
    return not is_unit(stated) or factor_between(stated, _unit_wanted(topic, field)) is not None


def _unit_wanted(topic: str, field: str) -> str:
    return next(item.unit for item in CHANNELS[topic].fields if item.name == field)


def _field_lines(field: str, found: list[str], topic: str, content: Content) -> list[str]:
    wanted = _unit_wanted(topic, field)
    unit, why = _unit_of(found[0], wanted, content)
    if wanted == "metadata":
        unit, why = None, 'say its unit: metadata = { unit = "V" }'
    given = f", unit = {_quoted(unit)}" if unit else ""
    others = f"; also possible: {', '.join(found[1:4])}" if len(found) > 1 else ""
    return [
        f"{field} = {{ column = {_quoted(found[0])}{given} }}  # guessed by name; {why}{others}"
    ]


def _free_lines(
    left: list[str], columns: Mapping[str, NDArray[Any]], content: Content, path: Path
) -> list[str]:
    """What no topic of the table has, one free topic per group and length."""
    groups: dict[tuple[str, int, str], list[str]] = {}
    for name in left:
        key = (
            _without_unit(name).rpartition("/")[0],
            len(columns[name]),
            content.times.get(name, ""),
        )
        groups.setdefault(key, []).append(name)
    lines, topics = [], set()
    for (group, _, _), names in groups.items():
        topic = base = f"/import/{_word(group or path.stem)}"
        number = 1
        while topic in topics:
            number += 1
            topic = f"{base}_{number}"
        topics.add(topic)
        lines += ["", f'[channels."{topic}".fields]']
        seen: set[str] = set()
        for name in names:
            field = base_field = _word(_without_unit(name).rpartition("/")[2])
            number = 1
            while field in seen:
                number += 1
                field = f"{base_field}_{number}"
            seen.add(field)
            lines.append(f"{field} = {{ column = {_quoted(name)} }}")
    return lines


def _word(text: str) -> str:
    word = re.sub(r"[^a-z0-9]+", "_", _bare(text)).strip("_")
    return word if re.match(r"[a-z]", word) else f"x_{word}".rstrip("_")


def _quoted(text: str) -> str:
    import json

    return json.dumps(text, ensure_ascii=False)
