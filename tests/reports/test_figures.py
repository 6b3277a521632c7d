"""Static drawings: every spike is there, gaps stay open, bands do not drown curves."""

import re

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from seamlog.reports.axes import axis_ticks
from seamlog.reports.curves import Column, Histogram, Limit, Mark, SeamPlot, Series
from seamlog.reports.figures import Drawing, draw_histogram, draw_plot

Floats = NDArray[np.float64]


def _plot(y: Floats, **extra: object) -> SeamPlot:
    series = Series(label="width", unit="mm", values=Column(values=y))
    base: dict[str, object] = {
        "id": "p",
        "title": "Width",
        "domain": "d",
        "x": Column(values=np.arange(y.size, dtype=float)),
        "x_label": "along the seam",
        "x_unit": "mm",
        "y_label": "width",
        "series": [series],
    }
    return SeamPlot.model_validate(base | extra)


def _path(drawing: Drawing, css: str) -> str:
    return next(shape.path for shape in drawing.shapes if shape.css.startswith(css))


def _points(path: str) -> Floats:
    numbers = [float(text) for text in re.findall(r"-?\d+\.\d", path)]
    return np.array(numbers).reshape(-1, 2)


@given(st.integers(0, 99_999), st.sampled_from([-1.0, 1.0]))
@settings(deadline=None, max_examples=30)
def test_a_single_spike_among_many_points_is_drawn(at: int, sign: float) -> None:
    y = np.sin(np.arange(100_000) / 300)
    y[at] = 9 * sign
    points = _points(_path(draw_plot(_plot(y)), "line"))
    assert len(points) < 2_000
    reached = points[:, 1].min() if sign > 0 else points[:, 1].max()
    frame = draw_plot(_plot(y)).box
    edge = frame.top if sign > 0 else frame.bottom
    assert abs(reached - edge) < 0.1 * (frame.bottom - frame.top)


def test_gaps_stay_open() -> None:
    y = np.ones(1000)
    y[400:500] = np.nan
    path = _path(draw_plot(_plot(y)), "line")
    assert path.count("M") == 2


def test_more_gaps_than_can_be_drawn_bridge_nothing() -> None:
    y = np.full(10_000, np.nan)
    y[::3] = 1.0
    y[4000:6000] = np.nan
    drawing = draw_plot(_plot(y))
    starts = [float(text) for text in re.findall(r"M(\d+) ", _path(drawing, "line"))]
    width = drawing.box.right - drawing.box.left
    hole = (drawing.box.left + 0.41 * width, drawing.box.left + 0.59 * width)
    assert starts
    assert not [x for x in starts if hole[0] < x < hole[1]]


def test_a_wide_band_leaves_the_curve_readable() -> None:
    y = np.sin(np.arange(500) / 20)
    wide = np.full(500, 0.1)
    wide[:20] = 1e6
    edges = {"low": Column(values=y - wide), "high": Column(values=y + wide)}
    series = Series(label="a", unit="", values=Column(values=y), **edges)
    points = _points(_path(draw_plot(_plot(y, series=[series])), "line"))
    box = draw_plot(_plot(y)).box
    assert np.ptp(points[:, 1]) > 0.4 * (box.bottom - box.top)


def test_limits_and_marks_are_drawn_and_named() -> None:
    extra = {
        "limits": [Limit(label="upper limit 7 mm", value=7.0)],
        "marks": [Mark(x=50, label="wide"), Mark(x=5000, label="elsewhere")],
    }
    tips = [shape.tip for shape in draw_plot(_plot(np.ones(100), **extra)).shapes]
    assert "upper limit 7 mm" in tips
    assert "wide" in tips
    assert "elsewhere" not in tips


def test_the_tolerance_is_shaded_between_its_limits() -> None:
    drawing = draw_plot(_plot(np.linspace(0, 10, 100), tolerance=(2.0, 8.0)))
    low, high = (
        float(text) for text in re.findall(r"[ V](\d+\.\d)[HV]", _path(drawing, "tolerance"))[:2]
    )
    line = _points(_path(drawing, "line"))
    y = np.interp([2.0, 8.0], np.linspace(0, 10, len(line)), line[:, 1])
    assert np.allclose([low, high], y, atol=0.3)


def test_nothing_and_nothing_finite_can_be_drawn() -> None:
    for y in (np.array([]), np.full(5, np.nan), np.array([3.0])):
        assert "width" in draw_plot(_plot(y)).label


def test_histogram_bars_are_as_high_as_their_counts() -> None:
    histogram = Histogram(
        id="h", title="t", x_label="w", unit="mm", edges=[0, 1, 2, 3], counts=[2, 0, 4]
    )
    drawing = draw_histogram(histogram)
    tops = [float(text) for text in re.findall(r"V(\d+\.\d)", _path(drawing, "bars"))]
    heights = [drawing.box.bottom - top for top in tops]
    assert len(heights) == 2
    assert abs(heights[1] / heights[0] - 2) < 0.02


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(3, 9))
def test_ticks_are_few_round_and_inside(low: float, span: float, wanted: int) -> None:
    ticks = axis_ticks(low, low + span, wanted)
    assert wanted / 2 - 1 <= len(ticks) <= 2 * wanted
    rounding = 1e-6 * span + 4 * float(np.spacing(abs(low) + span))
    assert all(low - rounding <= value <= low + span + rounding for value, _ in ticks)
    assert len({text for _, text in ticks}) == len(ticks)
