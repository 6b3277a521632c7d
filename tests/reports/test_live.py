"""Zoom, pixel columns and export of the live plots, in a real browser."""

import csv
import io
import json
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page

from seamlog.reports.report import Report
from seamlog.results import Part, Results
from tests.browsing import Visitor

Floats = NDArray[np.float64]
START_NS = 1_767_225_600_000_000_000
DENSE = 40_000
TIME = "0/time"
COLUMNS = """([xs, ys, min, max, width]) => {
    SOURCE;
    const levels = levelsOf(ys);
    let first = firstAtLeast(xs, min, 0, xs.length);
    let last = firstAtLeast(xs, max, first, xs.length) - 1;
    const found = [];
    eachColumn(xs, ys, levels, first, last, min, max, width, (...column) => found.push(column));
    return JSON.stringify([first, last, found]);
}"""
INK = """([id, value, at]) => {
    const canvas = document.querySelector(`#${id} canvas`);
    const { width, height } = canvas;
    const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
    const over = document.querySelector(`#${id} .u-over`).getBoundingClientRect();
    const box = canvas.getBoundingClientRect();
    const scale = width / box.width;
    const left = (over.left - box.left) * scale, wide = over.width * scale;
    const upper = (over.top - box.top) * scale, lower = (over.bottom - box.top) * scale;
    const column = Math.floor(left + at * wide);
    let top = height, bottom = -1;
    for (let x = column - 1; x <= column + 1; x++) {
        for (let y = Math.ceil(upper); y < lower; y++) {
            const i = 4 * (y * width + x);
            if (data[i + 3] <= 60 || data[i + 2] <= data[i] + 60) continue;
            top = Math.min(top, y);
            bottom = Math.max(bottom, y);
        }
    }
    return [top, bottom, upper, lower];
}"""


@pytest.fixture(scope="module")
def blank(_browser: Browser) -> Iterator[Page]:
    context = _browser.new_context()
    page = context.new_page()
    page.set_content("<!doctype html><title>blank</title>")
    yield page
    context.close()


def _brute(xs: Floats, ys: Floats, low: float, high: float, width: int) -> dict[int, list[float]]:
    """First, lowest, highest and last value by pixel column, the slow way."""
    found: dict[int, list[float]] = {}
    for x, y in zip(xs.tolist(), ys.tolist(), strict=True):
        if low <= x < high:
            column = int((x - low) // ((high - low) / width))
            entry = found.setdefault(column, [y, y, y, y])
            entry[1], entry[2], entry[3] = min(entry[1], y), max(entry[2], y), y
    return found


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 5000),
    st.floats(0, 0.9),
    st.floats(0.01, 1),
    st.integers(20, 1500),
)
@settings(deadline=None, max_examples=60)
def test_each_pixel_column_has_its_true_minimum_and_maximum(
    blank: Page, seed: int, count: int, start: float, share: float, width: int
) -> None:
    random = np.random.default_rng(seed)
    xs = np.cumsum(np.round(random.exponential(1.0, count), 3) + 0.001)
    ys = np.round(random.standard_cauchy(count), 3)
    low = float(xs[0] + start * np.ptp(xs))
    high = low + max(share * float(np.ptp(xs)), 0.5)
    source = files("seamlog.reports").joinpath("assets", "columns.js").read_text()
    asked: list[Any] = [xs.tolist(), ys.tolist(), low, high, width]
    first, last, found = json.loads(blank.evaluate(COLUMNS.replace("SOURCE", source), asked))
    inside = (xs >= low) & (xs < high)
    assert last - first + 1 == int(inside.sum())
    expected = _brute(xs, ys, low, high, width)
    # A value on the border of two columns may stand in either: compare those that are clear of it.
    per_pixel = (high - low) / width
    place = (xs[inside] - low) / per_pixel
    doubtful = {round(p) + d for p in place[np.abs(place - np.rint(place)) < 1e-6] for d in (-1, 0)}
    got = {column: values for column, *values in found}
    for column in set(expected) - doubtful:
        assert got[column] == expected[column]
    assert min(v[1] for v in got.values()) == ys[inside].min() if got else not inside.any()


@pytest.fixture(scope="module")
def dense(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Floats]:
    """A report of 40,000 points with single-sample spikes, and its values."""
    folder = tmp_path_factory.mktemp("dense")
    random = np.random.default_rng(5)
    y = np.round(np.sin(np.arange(DENSE) / 700) + random.normal(0, 0.1, DENSE), 3)
    y[random.integers(0, DENSE, 12)] = 4.0
    y[random.integers(0, DENSE, 12)] = -4.0
    stamps = START_NS + np.arange(DENSE) * 1_000_000
    results = Results.create(folder / "results")
    columns = {"stamp_ns": stamps, "wave": y}
    results.write(Part(part="signals", title="Signals"), tables={"wave": (columns, {})})
    report = Report()
    report.add_results(results)
    report.write(folder / "report.html")
    return folder / "report.html", y


def test_a_spike_of_one_sample_is_seen_at_every_zoom(
    visitor: Visitor, dense: tuple[Path, Floats]
) -> None:
    path, y = dense
    page = visitor.open(path).page
    random = np.random.default_rng(3)
    for spike in np.flatnonzero(np.abs(y) == 4.0)[::3].tolist():
        span = float(random.uniform(8, 39))
        low = max(min(spike / 1000 - random.uniform(0.1, 0.9) * span, 39.9 - span), 0.0)
        page.evaluate("([a, b]) => seamlog.zoom('0/time', a, b)", [low, low + span])
        page.evaluate("() => new Promise(done => requestAnimationFrame(() => setTimeout(done)))")
        at = (spike / 1000 - low) / span
        asked = ["plot-0-signals-wave-wave", float(y[spike]), at]
        top, bottom, upper, lower = page.evaluate(INK, asked)
        reached = (top - upper) if y[spike] > 0 else (lower - bottom)
        assert reached < 0.16 * (lower - upper), (spike, low, span)


def test_zoom_of_time_zooms_the_seam_and_back(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page).page
    page.evaluate("seamlog.zoom('0/time', 45, 55)")
    assert page.locator("#zoom-all").is_enabled()
    rows = _exported(page, "plot-0-bead-stations-width_mm")
    places = [float(row[0]) for row in rows[1:]]
    assert 80 < min(places) < 100 and 125 < max(places) < 150
    page.locator("#zoom-all").click()
    assert page.locator("#zoom-all").is_disabled()
    assert len(_exported(page, "plot-0-bead-stations-width_mm")) - 1 == 776
    page.locator("#zoom-in").click()
    fewer = len(_exported(page, "plot-0-bead-stations-width_mm")) - 1
    assert 200 < fewer < 500


def _exported(page: Page, plot: str) -> list[list[str]]:
    with page.expect_download() as download:
        page.locator(f"#{plot} button.csv").click()
    assert download.value.suggested_filename == f"{plot}.csv"
    return list(csv.reader(io.StringIO(Path(download.value.path()).read_text())))


def test_csv_of_the_view_has_the_numbers_of_the_results(
    visitor: Visitor, sample_page: Path, sample: Results
) -> None:
    page = visitor.open(sample_page).page
    page.evaluate("seamlog.zoom('0/photo/1', 100, 110)")
    header, *rows = _exported(page, "plot-0-bead-stations-width_mm")
    assert header[:2] == ["along the bead on the photo [mm]", "width [mm]"]
    part = next(part for part in sample.parts() if part.part == "bead")
    table = sample.columns(part, "stations")
    inside = (table["s_mm"] >= 100) & (table["s_mm"] <= 110)
    assert [float(row[0]) for row in rows] == table["s_mm"][inside].tolist()
    found = np.array([float(row[1]) if row[1] else np.nan for row in rows])
    known = np.isfinite(found)
    assert np.allclose(found[known], table["width_mm"][inside][known], atol=1e-3)


def test_keys_zoom_and_pan(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page).page
    plot = "plot-0-bead-stations-width_mm"
    page.locator(f"#{plot} .live").focus()
    page.keyboard.press("+")
    before = _exported(page, plot)
    page.locator(f"#{plot} .live").focus()
    page.keyboard.press("Control+ArrowRight")
    after = _exported(page, plot)
    assert float(after[1][0]) > float(before[1][0]) + 10
    page.locator(f"#{plot} .live").focus()
    page.keyboard.press("Escape")
    assert len(_exported(page, plot)) - 1 == 776
