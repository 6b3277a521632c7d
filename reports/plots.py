"""Tables to plots by one rule: `stamp_ns` makes a time plot, `s_mm` a plot along the seam.

Columns of one unit share a plot; errors and residuals stand apart from the larger things they are
the difference of. `u_<name>` is the standard uncertainty of `<name>` and becomes its band of U
(k = 2); `band_low_<name>` and `band_high_<name>` are the band of the column whose name ends alike.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seamlog.errors import UsageError
from seamlog.results import Part

from .curves import Column, CurvePlot, Limit, Mark, SeamPlot, Series, TimePlot
from .numbers import COVERAGE, spelled_unit
from .run import Run, anchor

Columns = dict[str, NDArray[Any]]
_DIFFERENCES = ("error", "residual")
"""Endings of what is small beside the things it is the difference of."""
AXES = ("s_mm", "s_px", "stamp_ns")
"""Columns that a table can run along, the first it has being its x."""
_SUFFIXES = {
    "mm": "mm",
    "mm_s2": "mm/s²",
    "mm_s": "mm/s",
    "m_s2": "m/s²",
    "mm2": "mm²",
    "deg": "°",
    "m_s": "m/s",
    "m": "m",
    "px": "px",
    "a": "A",
    "v": "V",
    "s": "s",
    "ns": "ns",
    "kj_mm": "kJ/mm",
    "m_min": "m/min",
}
"""Endings of names that are units, longest match first."""
_LONGEST_LABEL = 32
_FEWEST = 5
"""Rows from which a table over a quantity of its own is a curve."""
_STRIPS = 3
"""From this many plots of one table on, they are drawn as low strips."""


def split_unit(name: str) -> tuple[str, str]:
    """A column name as words and the unit at its end: weld_speed_mm_s -> weld speed, mm/s."""
    for suffix in sorted(_SUFFIXES, key=len, reverse=True):
        if name.endswith(f"_{suffix}"):
            return name[: -len(suffix) - 1].replace("_", " "), _SUFFIXES[suffix]
    return name.replace("_", " "), ""


def plots_of(
    run: Run, part: Part, table: str, title: str = ""
) -> list[TimePlot | SeamPlot | CurvePlot]:
    """Every plottable column of a table, one plot per unit; a table without axis gives none."""
    axis = axis_of(run, part, table)
    if axis is None:
        return []
    columns, units = run.columns(part, table), part.tables[table].columns
    groups = _by_unit({name: column for name, column in columns.items() if name != axis}, units)
    compact = len(groups) >= _STRIPS
    return [make_plot(run, part, table, names, title, compact=compact) for names in groups]


def axis_of(run: Run, part: Part, table: str) -> str | None:
    """What a table runs along: time, seam, or its first column, if that ascends and has a unit."""
    names = list(part.tables[table].columns)
    if shared := next((name for name in AXES if name in names), None):
        return shared
    first = run.columns(part, table)[names[0]] if names else np.empty(0)
    ascends = first.dtype.kind == "f" and first.size >= _FEWEST and bool(np.all(np.diff(first) > 0))
    return names[0] if ascends and split_unit(names[0])[1] else None


def make_plot(
    run: Run,
    part: Part,
    table: str,
    names: Sequence[str],
    title: str = "",
    limits: Sequence[Limit] = (),
    caption: str = "",
    label: str = "",
    compact: bool = False,
) -> TimePlot | SeamPlot | CurvePlot:
    """One plot of the columns `names` of a table that has an axis."""
    columns = run.columns(part, table)
    units = part.tables[table].columns
    axis = axis_of(run, part, table)
    assert axis is not None
    x, ordered = _ordered(run, axis, columns)
    series = [_series(name, units, ordered, single=len(names) == 1) for name in names]
    words = label or ", ".join(dict.fromkeys(s.label for s in series))
    common: dict[str, Any] = {
        "id": anchor("plot", str(run.index), part.stem, table, names[0]),
        "title": title or f"{words[:1].upper()}{words[1:]}",
        "caption": caption,
        "x": Column(values=x),
        "y_label": _axis_label("" if compact else words, series[0].unit),
        "series": series,
        "limits": list(limits),
        "compact": compact,
    }
    if axis == "stamp_ns":
        return TimePlot(domain=run.time_domain, x_label="time", x_unit="s", **common)
    if axis not in AXES:
        domain = f"{run.index}/own/{part.stem}/{axis}"
        words, unit = split_unit(axis)
        return CurvePlot(domain=domain, x_label=words, x_unit=unit, **common)
    return SeamPlot(
        domain=run.seam_domain(part) + ("/px" if axis == "s_px" else ""),
        x_label="along the bead on the photo" if part.part == "bead" else "along the seam",
        x_unit=split_unit(axis)[1],
        marks=_marks(part, axis),
        **common,
    )


def _ordered(run: Run, axis: str, columns: Columns) -> tuple[NDArray[Any], Columns]:
    """Ascending x known everywhere, and the other columns in the same order."""
    raw = columns[axis]
    x = run.seconds(raw) if axis == "stamp_ns" else raw.astype(np.float64)
    order = np.flatnonzero(np.isfinite(x))
    if np.any(np.diff(x[order]) < 0):
        order = order[np.argsort(x[order], kind="stable")]
    return x[order], {name: values[order] for name, values in columns.items()}


def _series(name: str, units: dict[str, str], columns: Columns, single: bool) -> Series:
    label, guessed = split_unit(name)
    low, high, band = _band(name, columns, single)
    return Series(
        label=label,
        unit=spelled_unit(units.get(name) or guessed),
        values=Column(values=columns[name].astype(np.float64)),
        low=None if low is None else Column(values=low),
        high=None if high is None else Column(values=high),
        band_label=band,
        step=label.endswith("command"),
    )


def _band(
    name: str, columns: Columns, single: bool
) -> tuple[NDArray[Any] | None, NDArray[Any] | None, str]:
    if f"u_{name}" in columns:
        value, expanded = columns[name], COVERAGE * columns[f"u_{name}"]
        return value - expanded, value + expanded, f"± U (k = {COVERAGE})"
    for low in columns:
        high = low.replace("band_low_", "band_high_")
        stem = low.removeprefix("band_low_")
        if single and stem != low and high in columns and name.endswith(stem):
            return columns[low], columns[high], "band"
    return None, None, ""


def _by_unit(columns: Columns, units: dict[str, str]) -> list[list[str]]:
    groups: dict[str, list[str]] = {}
    for name, values in columns.items():
        if not is_curve(name, values):
            continue
        unit = units.get(name) or split_unit(name)[1]
        own = "difference " if split_unit(name)[0].endswith(_DIFFERENCES) else ""
        groups.setdefault(own + (unit or name), []).append(name)
    return list(groups.values())


def is_curve(name: str, values: NDArray[Any]) -> bool:
    """Whether a column is to be drawn: numbers that are no axis and no band of another."""
    if name in AXES or name.startswith(("u_", "band_low_", "band_high_")):
        return False
    return values.dtype.kind in "fiu" and bool(np.isfinite(values.astype(np.float64)).any())


def _axis_label(words: str, unit: str) -> str:
    shown = f"[{unit}]" if unit and unit != "1" else ""
    return f"{words[:_LONGEST_LABEL]} {shown}".strip()


def _marks(part: Part, axis: str) -> list[Mark]:
    if axis != "s_mm":
        return []
    return [
        Mark(x=finding.place.s_mm, label=finding.message)
        for finding in part.findings
        if finding.place is not None and finding.place.s_mm is not None
    ]


def make_curves(
    name: str,
    title: str,
    x: ArrayLike,
    curves: Mapping[str, ArrayLike],
    unit: str,
    x_label: str,
    x_unit: str,
    limits: Mapping[str, float],
) -> TimePlot:
    """A plot of a caller's own arrays, all of the length of `x`; `UsageError` if they are not."""
    places = np.asarray(x, dtype=np.float64)
    columns = {label: np.asarray(values, dtype=np.float64) for label, values in curves.items()}
    if places.ndim != 1 or any(values.shape != places.shape for values in columns.values()):
        raise UsageError(f"{title}: x and all curves must be of one dimension and one length")
    if not np.isfinite(places).all() or np.any(np.diff(places) < 0):
        raise UsageError(f"{title}: x must ascend and have no gap")
    return TimePlot(
        id=anchor("plot", name),
        title=title,
        domain=f"own/{name}",
        x=Column(values=places),
        x_label=x_label,
        x_unit=x_unit,
        y_label=_axis_label("", unit),
        series=[
            Series(label=label, unit=unit, values=Column(values=values))
            for label, values in columns.items()
        ],
        limits=[Limit(label=label, value=value) for label, value in limits.items()],
    )
