"""Plots as static drawings: what is seen without JavaScript, in print, and until the live plot is.

Colours are classes; the style sheet gives them their light and dark values.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .axes import Scale, Tick, padded
from .curves import Column, Histogram, Plot, Series
from .numbers import format_quantity
from .paths import area_path, curve_path

_LEFT, _RIGHT, _TOP, _BOTTOM = 66, 14, 12, 44
COLOURS = 6
BAND_REACH = 0.5
"""How far a band may stretch the y axis beyond the values, in spans of the values."""


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


def draw_plot(plot: Plot) -> Drawing:
    """The static drawing of a plot."""
    box = STRIP if plot.compact else FULL
    x = plot.x.values
    across = Scale(*_x_range(x), box.left, box.right)
    up = Scale(*_y_range(plot), box.bottom, box.top)
    shapes: list[Shape] = []
    if plot.tolerance is not None:
        low, high = (float(up.px(value)) for value in plot.tolerance)
        area = f"M{box.left} {low:.1f}H{box.right}V{high:.1f}H{box.left}Z"
        shapes.append(Shape(area, "tolerance", "tolerance"))
    for number, series in enumerate(plot.series):
        if series.low is not None and series.high is not None:
            low, high = (np.clip(e.values, up.low, up.high) for e in (series.low, series.high))
            area = area_path(x, low, high, across, up)
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
        curve = curve_path(x, series.values.values, across, up, series.step)
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
    across = Scale(*padded(min(at), max(at)), box.left, box.right)
    up = Scale(0.0, max(histogram.counts, default=0) * 1.08 or 1.0, box.bottom, box.top)
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


def _spoken(plot: Plot) -> str:
    return f"{plot.title}. " + "; ".join(_spoken_series(series) for series in plot.series)


def _spoken_series(series: Series) -> str:
    known = series.values.values[np.isfinite(series.values.values)]
    if known.size == 0:
        return f"{series.label}: no values"
    low, high = format_quantity(float(known.min())), format_quantity(float(known.max()))
    unit = f" {series.unit}" if series.unit else ""
    return f"{series.label}: {low} to {high}{unit}"
