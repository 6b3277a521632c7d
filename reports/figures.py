"""Plots as static drawings: what is seen without JavaScript, in print, and until the live plot is.

Each pixel column of a curve keeps its first, lowest, highest and last value (M4), so no spike is
lost. Colours are classes; the style sheet gives them their light and dark values.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .content import Column, Histogram, Plot, Series
from .numbers import format_quantity
from .ticks import axis_ticks, padded

_LEFT, _RIGHT, _TOP, _BOTTOM = 66, 14, 12, 44
_POINTS_PER_CURVE = 1600
COLOURS = 6
BAND_REACH = 0.5
"""How far a band may stretch the y axis beyond the values, in spans of the values."""
_MOST_RUNS = 200
"""Pieces between gaps that are drawn as curves; with more, each pixel column shows its extent."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A tick at pixel `at` with its text."""

    at: float
    text: str


@dataclass(frozen=True, slots=True)
class Shape:
    """A path of the drawing with its class; `tip` is the text of a mark or limit."""

    path: str
    css: str
    tip: str = ""


@dataclass(frozen=True, slots=True)
class Box:
    """Size of a drawing, and the frame of the curves in it, in pixels."""

    width: int
    height: int
    left: int = _LEFT
    top: int = _TOP

    @property
    def right(self) -> int:
        """Right edge of the frame."""
        return self.width - _RIGHT

    @property
    def bottom(self) -> int:
        """Lower edge of the frame."""
        return self.height - _BOTTOM


FULL, STRIP, SMALL = Box(960, 250), Box(960, 165), Box(640, 230)


@dataclass(frozen=True, slots=True)
class Drawing:
    """A plot ready for the template."""

    label: str
    box: Box
    x_title: str
    y_title: str
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    shapes: list[Shape]


@dataclass(frozen=True, slots=True)
class _Scale:
    low: float
    high: float
    start: float
    end: float

    def px(self, values: NDArray[Any] | float) -> Any:
        fraction = (values - self.low) / (self.high - self.low)
        return self.start + fraction * (self.end - self.start)

    def ticks(self, wanted: int) -> list[Tick]:
        found = axis_ticks(self.low, self.high, wanted)
        return [Tick(round(float(self.px(value)), 1), text) for value, text in found]


def draw_plot(plot: Plot) -> Drawing:
    """The static drawing of a plot."""
    box = STRIP if plot.compact else FULL
    x = plot.x.values
    across = _Scale(*_x_range(x), box.left, box.right)
    up = _Scale(*_y_range(plot), box.bottom, box.top)
    shapes: list[Shape] = []
    for number, series in enumerate(plot.series):
        if series.low is not None and series.high is not None:
            low, high = (np.clip(e.values, up.low, up.high) for e in (series.low, series.high))
            area = _area(x, low, high, across, up)
            shapes.append(Shape(area, f"band c{number % COLOURS + 1}"))
    for limit in plot.limits:
        y = up.px(limit.value)
        shapes.append(Shape(f"M{box.left} {y:.1f}H{box.right}", "limit", limit.label))
    shapes += [
        Shape(f"M{across.px(mark.x):.1f} {box.top}V{box.bottom}", "mark", mark.label)
        for mark in plot.marks
        if across.low <= mark.x <= across.high
    ]
    for number, series in enumerate(plot.series):
        curve = _curve(x, series.values.values, across, up, series.step)
        shapes.append(Shape(curve, f"line c{number % COLOURS + 1}"))
    return Drawing(
        label=_spoken(plot),
        box=box,
        x_title=f"{plot.x_label} [{plot.x_unit}]",
        y_title=plot.y_label,
        x_ticks=across.ticks(9),
        y_ticks=up.ticks(3 if plot.compact else 4),
        shapes=shapes,
    )


def draw_histogram(histogram: Histogram) -> Drawing:
    """The static drawing of a histogram."""
    box = SMALL
    edges = np.asarray(histogram.edges)
    at = [*histogram.edges, *(limit.value for limit in histogram.limits)]
    across = _Scale(*padded(min(at), max(at)), box.left, box.right)
    up = _Scale(0.0, max(histogram.counts, default=0) * 1.08 or 1.0, box.bottom, box.top)
    bars = "".join(
        f"M{across.px(a):.1f} {box.bottom}V{up.px(n):.1f}H{across.px(b):.1f}V{box.bottom}Z"
        for a, b, n in zip(edges[:-1], edges[1:], histogram.counts, strict=True)
        if n
    )
    lines = [
        Shape(f"M{across.px(limit.value):.1f} {box.top}V{box.bottom}", "limit", limit.label)
        for limit in histogram.limits
    ]
    return Drawing(
        label=f"{histogram.title}: {sum(histogram.counts)} values from "
        f"{format_quantity(histogram.edges[0])} to "
        f"{format_quantity(histogram.edges[-1], unit=histogram.unit)}",
        box=box,
        x_title=f"{histogram.x_label} [{histogram.unit}]",
        y_title="stations",
        x_ticks=across.ticks(7),
        y_ticks=up.ticks(4),
        shapes=[Shape(bars, "bars c1"), *lines],
    )


def _x_range(x: NDArray[Any]) -> tuple[float, float]:
    if x.size == 0:
        return 0.0, 1.0
    low, high = float(x[0]), float(x[-1])
    return (low, high) if high > low else padded(low, high)


def _y_range(plot: Plot) -> tuple[float, float]:
    """The values, the limits, and as much of the bands as leaves the curves readable."""
    values = _extent(series.values for series in plot.series)
    edges = _extent(edge for s in plot.series for edge in (s.low, s.high) if edge is not None)
    seen = [limit.value for limit in plot.limits]
    if values is not None:
        low, high = values
        if edges is not None:
            reach = BAND_REACH * (high - low) or float("inf")
            low = min(low, max(edges[0], low - reach))
            high = max(high, min(edges[1], high + reach))
        seen += [low, high]
    return padded(min(seen), max(seen)) if seen else (0.0, 1.0)


def _extent(columns: Iterable[Column]) -> tuple[float, float] | None:
    known = [c.values[np.isfinite(c.values)] for c in columns]
    known = [values for values in known if values.size]
    if not known:
        return None
    return min(float(v.min()) for v in known), max(float(v.max()) for v in known)


def _runs(y: NDArray[Any]) -> list[tuple[int, int]]:
    """Half-open index ranges without gaps."""
    known = np.concatenate(([False], np.isfinite(y), [False]))
    turns = np.flatnonzero(np.diff(known.astype(np.int8)))
    return [(int(a), int(b)) for a, b in turns.reshape(-1, 2)]


def _thin(x: NDArray[Any], y: NDArray[Any], points: int) -> NDArray[np.intp]:
    """Indices of the points that a drawing of `points` needs (M4 per pixel column)."""
    if y.size <= points:
        return np.arange(y.size)
    from tsdownsample import M4Downsampler

    wide = np.ascontiguousarray(y, dtype=np.float64)
    thin: Any = M4Downsampler
    kept = thin().downsample(np.ascontiguousarray(x, np.float64), wide, n_out=points)
    indices: NDArray[np.intp] = np.unique(kept.astype(np.intp))
    return indices


def _points(x: NDArray[Any], y: NDArray[Any]) -> str:
    return " ".join(f"{a:.1f} {b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))


def _curve(x: NDArray[Any], y: NDArray[Any], across: _Scale, up: _Scale, step: bool) -> str:
    runs = _runs(y)
    if len(runs) > _MOST_RUNS:
        return _extents(across.px(x), up.px(y), up.px(y))
    total = max(sum(b - a for a, b in runs), 1)
    pieces = []
    for a, b in runs:
        share = max(4 * (_POINTS_PER_CURVE * (b - a) // total // 4), 8)
        kept = a + _thin(x[a:b], y[a:b], share)
        pieces.append(_piece(across.px(x[kept]), up.px(y[kept]), step))
    return "".join(pieces)


def _extents(x: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> str:
    """Per pixel column a bar from the lowest to the highest known value; none where none is."""
    known = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
    column = np.rint(x[known]).astype(int)
    top = np.full(FULL.width + 1, np.inf)
    bottom = np.full(FULL.width + 1, -np.inf)
    np.minimum.at(top, column, np.minimum(low, high)[known])
    np.maximum.at(bottom, column, np.maximum(low, high)[known])
    return "".join(
        f"M{i} {top[i] - 0.5:.1f}h1V{bottom[i] + 0.5:.1f}h-1Z"
        for i in np.flatnonzero(np.isfinite(top)).tolist()
    )


def _piece(x: NDArray[Any], y: NDArray[Any], step: bool) -> str:
    if x.size == 1:
        return f"M{x[0] - 1:.1f} {y[0]:.1f}h2"
    if step:
        x, y = np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]
    return "M" + _points(x, y)


def _area(
    x: NDArray[Any], low: NDArray[Any], high: NDArray[Any], across: _Scale, up: _Scale
) -> str:
    runs = _runs(np.where(np.isfinite(low) & np.isfinite(high), low, np.nan))
    if len(runs) > _MOST_RUNS:
        return _extents(across.px(x), up.px(low), up.px(high))
    half = _POINTS_PER_CURVE // 2
    pieces = []
    for a, b in runs:
        below, above = (a + _thin(x[a:b], edge[a:b], half) for edge in (low, high))
        there = _points(across.px(x[above]), up.px(high[above]))
        back = _points(across.px(x[below][::-1]), up.px(low[below][::-1]))
        pieces.append(f"M{there} {back}Z")
    return "".join(pieces)


def _spoken(plot: Plot) -> str:
    return f"{plot.title}. " + "; ".join(_spoken_series(series) for series in plot.series)


def _spoken_series(series: Series) -> str:
    known = series.values.values[np.isfinite(series.values.values)]
    if known.size == 0:
        return f"{series.label}: no values"
    low, high = format_quantity(float(known.min())), format_quantity(float(known.max()))
    unit = f" {series.unit}" if series.unit else ""
    return f"{series.label}: {low} to {high}{unit}"
