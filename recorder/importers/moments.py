"""Columns of dates and times of day as nanoseconds."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

_DAY_NS = 86_400 * 10**9


def moments_ns(column: Any, name: str, notes: list[str]) -> NDArray[np.int64] | None:
    """Ns since 1970 (UTC where no zone is given), or since midnight; None if these are no times."""
    import pandas as pd

    texts = column.dropna().astype(str).str.strip()
    texts = texts[texts != ""]
    if not len(texts) or len(texts) < len(column) or not texts.str.contains(r"\d[:/.-]\d").all():
        return None
    texts = texts.str.replace(",", ".", regex=False)
    if texts.str.fullmatch(r"\d{1,3}:\d{2}(:\d{2}(\.\d+)?)?").all():
        return _times_of_day(texts, name, notes)
    try:
        found = pd.to_datetime(texts, utc=True, format="ISO8601")
    except (ValueError, OverflowError):
        found = _other_dates(texts, name, notes)
        if found is None:
            return None
    if not texts.str.contains(r"(?:Z|[-+]\d{2}:?\d{2})$").all():
        notes.append(f"column {name!r} has no time zone and was taken as UTC")
    values: NDArray[np.int64] = found.dt.tz_localize(None).to_numpy("datetime64[ns]").view(np.int64)
    return values


def _other_dates(texts: Any, name: str, notes: list[str]) -> Any:
    import warnings

    import pandas as pd

    day_first = not texts.str.match(r"\d{1,2}/").all()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = pd.to_datetime(texts, utc=True, dayfirst=day_first)
        except (ValueError, OverflowError):
            return None
    order = "day before month" if day_first else "month before day"
    notes.append(f"column {name!r}: dates were read with the {order}")
    return found


def _times_of_day(texts: Any, name: str, notes: list[str]) -> NDArray[np.int64]:
    """Times of day; where they fall back by more than half a day, midnight has passed."""
    parts = texts.str.split(":", expand=True).astype(float).fillna(0.0).to_numpy()
    weights = np.array([3600.0, 60.0, 1.0])[: parts.shape[1]]
    values = np.rint((parts * weights).sum(axis=1) * 1e9).astype(np.int64)
    days = np.concatenate([[0], np.cumsum(np.diff(values) < -_DAY_NS // 2)])
    notes.append(f"column {name!r} holds times of day without a date: ns since midnight")
    found: NDArray[np.int64] = values + days * _DAY_NS
    return found
