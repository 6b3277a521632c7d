"""Columns of dates and times of day as nanoseconds; nothing is completed with today's date."""

import re
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

DAY_NS = 86_400 * 10**9
_TIME = (
    r"(?P<h>\d{1,3}):(?P<min>\d{2})(?::(?P<s>\d{2})(?:[.,](?P<f>\d{1,12})|:(?P<ms>\d{3}))?)?"
    r"(?:\s*(?P<half>[AP])\.?M\b\.?)?"
)
_SHORT_TIME = r"(?P<min>\d{1,3}):(?P<s>\d{2})[.,](?P<f>\d{1,9})"
_ZONE = r"(?:\s*(?P<zone>Z|[-+]\d{2}(?::?\d{2})?|[A-Z]{3,5}))?"
_YEAR = r"(?P<y>\d{4}|\d{2})"
_DATES = (
    r"(?P<y>\d{4})(?P<sep>[-/.])(?P<mon>\d{1,2})(?P=sep)(?P<d>\d{1,2})",
    rf"(?P<p>\d{{1,2}})(?P<sep>[-/.])(?P<q>\d{{1,2}})(?P=sep){_YEAR}",
    rf"(?P<d>\d{{1,2}})[-. ]+(?P<name>[^\W\d_]{{3,9}})\.?[-, ]+{_YEAR}",
    r"(?P<name>[^\W\d_]{3,9})\.? (?P<d>\d{1,2}),? (?P<y>\d{4})",
)
_MONTHS = {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
_MONTHS |= {
    name: number
    for number, name in enumerate(
        ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"), 1
    )
}
_NO_ZONE = "has no time zone and was taken as UTC"
_ISO = re.compile(
    r"\d{4}-\d{2}-\d{2}(?:[T ]\d{2}:\d{2}:\d{2}(?:\.\d{1,9})?)?(?:Z|[-+]\d{2}:?\d{2})?"
)
_CLOCK_APART = r"(?P<h>\d{2})[-._](?P<min>\d{2})[-._](?P<s>\d{2})(?:[.,](?P<f>\d{1,12}))?"
_CLOCK_BARE = r"(?P<h>\d{2})(?P<min>\d{2})(?P<s>\d{2})(?:[.,](?P<f>\d{1,12}))?"
_FORMS = (
    (
        re.compile(rf"(?P<y>\d{{4}})(?P<mon>\d\d)(?P<d>\d\d)[T _-]{_CLOCK_BARE}{_ZONE}", re.I),
        "moment",
    ),
    (
        re.compile(rf"(?P<y>\d{{4}})-(?P<mon>\d\d)-(?P<d>\d\d)[T _-]{_CLOCK_APART}{_ZONE}", re.I),
        "moment",
    ),
    (
        re.compile(
            rf"[A-Z]{{3}} (?P<name>[A-Z]{{3}}) +(?P<d>\d+) {_TIME}{_ZONE} (?P<y>\d{{4}})", re.I
        ),
        "moment",
    ),
    *((re.compile(rf"{date}(?:,?[T ]\s*{_TIME})?{_ZONE}", re.I), "moment") for date in _DATES),
    (re.compile(_TIME + _ZONE, re.I), "time of day"),
    (re.compile(_SHORT_TIME), "time of day"),
)


def is_moment(cell: str) -> bool:
    """Whether a cell is a date, a time of day, or both."""
    return any(form.fullmatch(cell) for form, _ in _FORMS)


@dataclass(frozen=True)
class Moments:
    """Ns since 1970 (UTC where no zone is given) of moments and dates, since midnight of times."""

    ns: NDArray[np.int64]
    kind: Literal["moment", "date", "time of day"]
    notes: list[str]


def moments_of(texts: Any) -> Moments | str | None:
    """A column of text without empty cells as times.

    None if it holds something else, a text with the reason where its times cannot be told.
    """
    found = _iso(texts) if _ISO.fullmatch(texts.iloc[0]) else None
    if found is not None:
        return found
    for form, kind in _FORMS:
        if form.fullmatch(texts.iloc[0]):
            parts = texts.str.extract(re.compile(f"^(?:{form.pattern})$", form.flags))
            key = "y" if kind == "moment" else "min"
            if not parts[key].notna().all():
                continue
            return _times_of_day(parts) if kind == "time of day" else _moments(parts)
    return None


def _iso(texts: Any) -> Moments | None:
    """The usual form, which pandas reads several times as fast; None where there is any doubt."""
    import pandas as pd

    has_time = texts.str.contains(":", regex=False)
    zoned = texts.str.contains(r"(?:Z|[-+]\d{2}:?\d{2})$")
    if has_time.nunique() > 1 or zoned.nunique() > 1:
        return None
    try:
        found = pd.to_datetime(texts, utc=True, format="ISO8601")
    except (ValueError, OverflowError):
        return None
    ns = found.dt.tz_localize(None).to_numpy("datetime64[ns]").view(np.int64)
    notes = [] if zoned.iloc[0] else [_NO_ZONE]
    return Moments(ns, "moment" if has_time.iloc[0] else "date", notes)


def _moments(parts: Any) -> Moments | str:
    has_time = "h" in parts and parts["h"].notna().any()
    notes: list[str] = []
    dates = _dates(parts, notes)
    if isinstance(dates, str):
        return dates
    year, month, day = dates
    months = (year - 1970) * 12 + month - 1
    first, after = (
        at.astype("M8[M]").astype("M8[D]").astype(np.int64) for at in (months, months + 1)
    )
    bad = (month < 1) | (month > 12) | (day < 1) | (day > after - first)
    if bad.any():
        return f"row {int(np.argmax(bad)) + 1} has no such date"
    ns = (first + day - 1) * DAY_NS
    if has_time:
        time = _clock(parts)
        if isinstance(time, str):
            return time
        ns = ns + time
    zone = _zone(parts["zone"])
    if isinstance(zone, str):
        return zone
    if zone is None:
        notes.append(_NO_ZONE)
        zone = np.zeros(1, np.int64)
    return Moments(ns - zone, "moment" if has_time else "date", notes)


def _dates(parts: Any, notes: list[str]) -> tuple[Any, Any, Any] | str:
    year = _whole(parts["y"])
    year = np.where(year < 70, year + 2000, np.where(year < 100, year + 1900, year))
    if "mon" in parts:
        return year, _whole(parts["mon"]), _whole(parts["d"])
    if "name" in parts:
        month = parts["name"].str.lower().str[:3].map(_MONTHS)
        if month.isna().any():
            return f"{parts['name'][month.isna()].iloc[0]!r} is no month that is known"
        return year, month.to_numpy(np.int64), _whole(parts["d"])
    one, two = _whole(parts["p"]), _whole(parts["q"])
    if (one > 12).any() and (two > 12).any():
        return "its dates have the day first in some rows and second in others"
    told = (one > 12).any() or (two > 12).any() or parts["sep"].iloc[0] == "."
    day_first = bool((one > 12).any()) or (not (two > 12).any() and _day_is_first(parts, one, two))
    order = "day before month" if day_first else "month before day"
    notes.append(f"dates were read with the {order}" + ("" if told else ", which nothing proves"))
    return (year, two, one) if day_first else (year, one, two)


def _day_is_first(parts: Any, one: NDArray[np.int64], two: NDArray[np.int64]) -> bool:
    """Where both are possible: a log spans fewer months than days, unless its signs tell more."""
    if parts["sep"].iloc[0] == ".":
        return True
    if len(set(one.tolist())) != len(set(two.tolist())):
        return len(set(one.tolist())) > len(set(two.tolist()))
    return bool(parts["sep"].iloc[0] == "-") and parts["half"].isna().all()


def _zone(zones: Any) -> NDArray[np.int64] | str | None:
    if zones.isna().all():
        return None
    if zones.isna().any():
        return "some rows have a time zone and some have none"
    text = zones.str.upper().replace({"Z": "+00:00", "UTC": "+00:00", "GMT": "+00:00"})
    named = text[text.str.contains("[A-Z]")]
    if len(named):
        return f"time zone {named.iloc[0]!r} may be several; write it as hours, such as +01:00"
    digits = text.str.replace(":", "", regex=False).str.ljust(5, "0")
    minutes = _whole(digits.str[1:3]) * 60 + _whole(digits.str[3:5])
    return np.where(digits.str[0] == "-", -minutes, minutes) * np.int64(60 * 10**9)


def _clock(parts: Any) -> NDArray[np.int64] | str:
    """Ns since midnight."""
    count = len(parts)
    hours = _whole(parts["h"]) if "h" in parts else np.zeros(count, np.int64)
    minutes, seconds = _whole(parts["min"]), _whole(parts["s"])
    if "half" in parts and parts["half"].notna().any():
        if parts["half"].isna().any() or (hours > 12).any() or (hours < 1).any():
            return "its times of day are on 12 hours in some rows only"
        hours = hours % 12 + 12 * (parts["half"].str.upper() == "P").to_numpy(np.int64)
    if (seconds > 60).any() or ("h" in parts and (minutes > 59).any()):
        return "it has more than 60 seconds or minutes"
    fraction = parts["f"].fillna("")
    if "ms" in parts:
        fraction = fraction.where(parts["ms"].isna(), parts["ms"])
    rest = _whole(fraction.str.ljust(9, "0").str[:9])
    return ((hours * 60 + minutes) * 60 + seconds) * 10**9 + rest


def _times_of_day(parts: Any) -> Moments | str:
    notes = ["holds times of day without a date: ns since midnight"]
    if "h" in parts and parts["s"].isna().all() and (_whole(parts["h"]) > 23).any():
        parts = parts.drop(columns="h").assign(min=parts["h"], s=parts["min"])
        notes.append("was read as minutes and seconds")
    time = _clock(parts)
    return time if isinstance(time, str) else Moments(time, "time of day", notes)


def past_midnight(ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Times of day that go on: where they fall back by half a day or more, midnight has passed."""
    days = np.concatenate([[0], np.cumsum(np.diff(ns) < -DAY_NS // 2)])
    found: NDArray[np.int64] = ns + days * DAY_NS
    return found


def _whole(texts: Any) -> NDArray[np.int64]:
    found: NDArray[np.int64] = texts.fillna("0").to_numpy(dtype=str).astype(np.int64)
    return found
