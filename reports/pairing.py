"""Paired differences of two runs: column by column at the same places or moments.

Neighbouring values of a log are alike, so n of them hold less than n pieces of evidence. The
confidence interval of a mean difference counts the effective ones: n / (1 + 2 sum of the
autocorrelations), summed over Geyer's initial positive sequence (Statist. Sci. 7, 1992).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.results import Part

from .block import Block
from .numbers import spelled_unit
from .plots import is_curve, split_unit
from .run import Run

Floats = NDArray[np.float64]
CONFIDENCE = 0.95
COMPARED = ("bead", "join", "tracking", "replay")
"""Parts whose tables are paired."""
_FEWEST_EFFECTIVE = 3.0
_ERRORS = ("error",)


class Paired(Block):
    """The mean of (other - base), with its confidence interval; None with the reason."""

    part: str
    index: int
    table: str
    column: str
    label: str
    unit: str
    run: str
    by: str
    count: int
    base_mean: float | None = None
    mean: float | None = None
    low: float | None = None
    high: float | None = None
    effective: float | None = None
    reason: str = ""


@dataclass(frozen=True)
class Curve:
    """A column of one run along its axis: ascending places, NaN where there is no value."""

    x: Floats
    y: Floats
    by: str

    def at(self, places: Floats) -> Floats:
        """Values at other places, NaN outside and beside gaps."""
        return np.interp(places, self.x, self.y, left=np.nan, right=np.nan)


@dataclass(frozen=True)
class Shared:
    """A column that the base and at least one other run have, with the curve of each run."""

    part: Part
    table: str
    column: str
    unit: str
    curves: tuple[Curve | None, ...]

    @property
    def is_error(self) -> bool:
        """Whether its magnitude counts, not its sign."""
        return split_unit(self.column)[0].endswith(_ERRORS)

    @property
    def label(self) -> str:
        """The column in words."""
        words = split_unit(self.column)[0]
        return f"{words}, magnitude" if self.is_error else words


def shared_columns(runs: Sequence[Run]) -> Iterator[Shared]:
    """Columns of the first run that others have too, part by part."""
    base = runs[0]
    for part in (part for kind in COMPARED for part in base.of(kind)):
        for table, entry in part.tables.items():
            for column, values in base.columns(part, table).items():
                if not is_curve(column, values) or _is_place_on_photo(column):
                    continue
                curves = tuple(_curve(run, part, table, column) for run in runs)
                if curves[0] is not None and any(curves[1:]):
                    unit = spelled_unit(entry.columns[column] or split_unit(column)[1])
                    yield Shared(part, table, column, unit, curves)


def pair(shared: Shared, runs: Sequence[Run]) -> list[Paired]:
    """Each other run against the first."""
    base = shared.curves[0]
    assert base is not None
    return [
        _paired(shared, base, curve, run.label)
        for run, curve in zip(runs[1:], shared.curves[1:], strict=True)
        if curve is not None
    ]


def mean_interval(differences: Floats) -> tuple[float, float, float] | None:
    """Low and high end of the mean's confidence interval, and the effective number of values.

    None where the values hold too little evidence.
    """
    from scipy.special import stdtrit

    effective = effective_count(differences)
    if effective < _FEWEST_EFFECTIVE:
        return None
    spread = float(np.std(differences, ddof=1)) / effective**0.5
    reach = float(stdtrit(effective - 1, 0.5 + CONFIDENCE / 2)) * spread
    mean = float(np.mean(differences))
    return mean - reach, mean + reach, effective


def effective_count(values: Floats) -> float:
    """How many independent values have the same variance of the mean."""
    centred = values - np.mean(values)
    power = float(np.dot(centred, centred))
    if len(values) < 4 or power == 0.0:
        return float(len(values))
    size = 1 << (2 * len(values) - 1).bit_length()
    transformed = np.fft.rfft(centred, size)
    correlation = np.fft.irfft(np.abs(transformed) ** 2, size)[: len(values)] / power
    pairs = correlation[0 : len(values) // 2 * 2 : 2] + correlation[1 : len(values) // 2 * 2 : 2]
    ends = np.flatnonzero(pairs <= 0)
    total = 2 * float(pairs[: int(ends[0]) if ends.size else len(pairs)].sum()) - 1
    return float(min(len(values) / max(total, 1e-9), len(values)))


def _paired(shared: Shared, base: Curve, other: Curve, run: str) -> Paired:
    first, second = base.y, other.at(base.x)
    if shared.is_error:
        first, second = np.abs(first), np.abs(second)
    known = np.isfinite(first) & np.isfinite(second)
    differences = (second - first)[known]
    head: dict[str, Any] = {
        "part": shared.part.part,
        "index": shared.part.index,
        "table": shared.table,
        "column": shared.column,
        "label": shared.label,
        "unit": shared.unit,
        "run": run,
        "by": base.by,
        "count": int(known.sum()),
    }
    if base.by != other.by or not differences.size:
        return Paired(**head, reason="no place or moment that both have")
    head |= {"mean": float(np.mean(differences)), "base_mean": float(np.mean(first[known]))}
    interval = mean_interval(differences)
    if interval is None:
        return Paired(**head, reason="too few values that are independent of each other")
    low, high, effective = interval
    return Paired(**head, low=low, high=high, effective=effective)


def _is_place_on_photo(column: str) -> bool:
    """Pixels of one photo say nothing about those of another, unless they are a width."""
    return column.endswith("_px") and not column.startswith("width")


def _curve(run: Run, like: Part, table: str, column: str) -> Curve | None:
    part = next((p for p in run.of(like.part) if p.index == like.index), None)
    if part is None or table not in part.tables:
        return None
    columns = run.columns(part, table)
    if column not in columns or not is_curve(column, columns[column]):
        return None
    if "s_mm" in columns:
        x, by = columns["s_mm"].astype(np.float64), "place along the seam [mm]"
    elif "stamp_ns" in columns:
        x, by = _since_start(run, part, columns["stamp_ns"]), "time since the start [s]"
    else:
        return None
    order = np.argsort(x, kind="stable")
    order = order[np.isfinite(x[order])]
    if order.size < 2:
        return None
    return Curve(x[order], columns[column].astype(np.float64)[order], by)


def _since_start(run: Run, part: Part, stamp_ns: NDArray[Any]) -> Floats:
    """Seconds since the weld began, else since the first stamp."""
    seconds = run.seconds(stamp_ns)
    start = part.details.get("start_ns")
    if isinstance(start, int):
        return seconds - run.second(start)
    return seconds - float(np.nanmin(seconds)) if np.isfinite(seconds).any() else seconds
