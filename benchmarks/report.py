"""The report beside Bokeh and Plotly: size, first paint, all drawn, panning, in one run.

Six signals at 1 kHz in six plots over one time, with spikes of single samples and motion of 7 to
12 Hz; 100 camera frames (the peers have none). Pan: all six x ranges are set, then the next frame
is awaited. Headless Chromium, software rendering; wall-clock times, so run it on a quiet machine.
"""

import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from figures import Figure, optional_peer, options, tell
from numpy.typing import NDArray
from playwright.sync_api import Browser, sync_playwright

from seamlog.reports.report import Report
from seamlog.results import Part, Picture, Results

Floats = NDArray[np.float64]
START_NS = 1_767_225_600_000_000_000
SIGNALS, FRAMES, PANS = 6, 100, 40
RATE_HZ = 1000
ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN"
PAN = """async ([low, high]) => {
    const frame = () => new Promise(requestAnimationFrame);
    await frame();
    const start = performance.now();
    SET;
    await frame();
    return performance.now() - start;
}"""


@dataclass(frozen=True)
class Page:
    """How one library's page is watched: when it is drawn, how its x ranges are set."""

    path: Path
    ready: str
    pan: str


@dataclass(frozen=True)
class Seen:
    """What a browser saw of a page, milliseconds; megabytes of the file."""

    megabytes: float
    paint_ms: float
    drawn_ms: float
    pans_ms: list[float]

    def pan_ms(self, quantile: float) -> float:
        """A quantile of the pans."""
        return float(np.quantile(self.pans_ms, quantile))


def signals(count: int, seed: int = 0) -> tuple[Floats, list[Floats]]:
    """Time and the six signals, at a resolution of a thousandth."""
    random = np.random.default_rng(seed)
    t = np.arange(count) / RATE_HZ
    found = []
    for i in range(SIGNALS):
        y = (i + 1) * np.sin(0.6 * t + i) + 0.2 * random.normal(size=count)
        y += 0.3 * np.sin(2 * np.pi * (7 + i) * t)
        y[random.integers(0, count, 20)] += random.normal(0, 5, 20)
        found.append(np.round(y, 3))
    return t, found


def frames(seconds: float, seed: int = 1) -> dict[str, tuple[bytes, Picture]]:
    """Grey noise of sd 12, blurred, with one bright line; thumbnails as `analyze` stores them."""
    random = np.random.default_rng(seed)
    found = {}
    for i in range(FRAMES):
        noise = random.normal(60, 12, (480, 640)).clip(0, 255).astype(np.uint8)
        image = cv2.GaussianBlur(noise, (0, 0), 1.5)
        cv2.line(image, (100 + 2 * i, 0), (400 - 2 * i, 479), 220, 6)
        small = cv2.resize(image, (320, 240), interpolation=cv2.INTER_AREA)
        data = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, 40])[1].tobytes()
        picture = Picture(
            file="frame.webp",
            caption="Camera",
            width_px=320,
            height_px=240,
            sha256="",
            time_ns=START_NS + round(1e9 * seconds * i / FRAMES),
        )
        found[f"frame_{i:03}"] = (data, picture)
    return found


def our_page(folder: Path, t: Floats, ys: Sequence[Floats]) -> tuple[Page, float]:
    """Our report, and the seconds it took from the results."""
    results = Results.create(folder / "results")
    stamps = START_NS + np.rint(1e9 * t).astype(np.int64)
    tables = {f"y{i}": ({"stamp_ns": stamps, f"y{i}": y}, {}) for i, y in enumerate(ys)}
    part = Part(part="signals", title="Signals")
    results.write(part, tables, frames(float(t[-1])))
    start = time.perf_counter()
    report = Report("Six signals")
    report.add_results(Results.open(folder / "results"))
    report.write(folder / "seamlog.html")
    took = time.perf_counter() - start
    pan = "seamlog.zoom('0/time', low, high)"
    ready = "document.documentElement.dataset.state === 'live'"
    return Page(folder / "seamlog.html", ready, pan), took


def bokeh_page(folder: Path, t: Floats, ys: Sequence[Floats]) -> Page:
    """Bokeh on its canvas, one file."""
    from bokeh.embed import file_html
    from bokeh.layouts import column
    from bokeh.plotting import figure
    from bokeh.resources import INLINE

    plots: list[Any] = []
    for y in ys:
        shared = {"x_range": plots[0].x_range} if plots else {}
        plot = figure(width=1000, height=200, **shared)
        plot.line(t, y)
        plots.append(plot)
    path = folder / "bokeh.html"
    path.write_text(file_html(column(*plots), INLINE, "six signals"))
    ready = "window.Bokeh && Bokeh.documents.length && Bokeh.documents[0].is_idle"
    plot = "Bokeh.documents[0].roots()[0].children[0]"
    pan = f"{plot}.x_range.setv({{start: low, end: high}})"
    return Page(path, ready, pan)


def plotly_page(folder: Path, t: Floats, ys: Sequence[Floats]) -> Page:
    """Plotly as SVG, its default, one file."""
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    whole = make_subplots(rows=len(ys), cols=1, shared_xaxes=True)
    for row, y in enumerate(ys, 1):
        whole.add_trace(go.Scatter(x=t, y=y, mode="lines"), row=row, col=1)
    whole.update_layout(height=1200)
    path = folder / "plotly.html"
    path.write_text(whole.to_html(include_plotlyjs=True))
    ready = "document.querySelectorAll('.js-line').length >= 6"
    plot = "document.querySelector('.js-plotly-plot')"
    pan = f"await Plotly.relayout({plot}, {{'xaxis.range': [low, high]}})"
    return Page(path, ready, pan)


def watch(browser: Browser, page: Page, seconds: float, pans: int = PANS) -> Seen:
    """Open a page in a fresh context and pan it."""
    with opened(browser) as tab:
        tab.goto(page.path.as_uri(), wait_until="commit")
        tab.wait_for_function(f"() => {page.ready}", timeout=120_000)
        drawn = tab.evaluate(
            "async () => { await new Promise(requestAnimationFrame); return performance.now(); }"
        )
        paint = tab.evaluate(PAINT)
        script = PAN.replace("SET", page.pan)
        ranges = [(seconds * k / (2 * pans), seconds * (k / (2 * pans) + 0.5)) for k in range(pans)]
        taken = [tab.evaluate(script, list(each)) for each in ranges]
    return Seen(page.path.stat().st_size / 1e6, paint, drawn, taken)


@contextmanager
def opened(browser: Browser) -> Iterator[Any]:
    """A tab of its own."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    yield context.new_page()
    context.close()


def repeated(browser: Browser, page: Page, seconds: float, times: int) -> Seen:
    """The median of several visits."""
    visits = [watch(browser, page, seconds) for _ in range(times)]
    return Seen(
        visits[0].megabytes,
        statistics.median(visit.paint_ms for visit in visits),
        statistics.median(visit.drawn_ms for visit in visits),
        [pan for visit in visits for pan in visit.pans_ms],
    )


def our_figures(name: str, seen: Seen, built_s: float, largest: float) -> list[Figure]:
    """Our report; paint and drawing have targets for the smaller data."""
    small = largest < 2
    return [
        Figure(f"{name}: file", seen.megabytes, "MB", f"<= {largest:g}"),
        Figure(f"{name}: build", built_s, "s"),
        Figure(f"{name}: first paint", seen.paint_ms / 1e3, "s", "<= 0.3" if small else ""),
        Figure(f"{name}: all drawn", seen.drawn_ms / 1e3, "s", "<= 1" if small else ""),
        Figure(f"{name}: pan, median", seen.pan_ms(0.5), "ms", "<= 20"),
        Figure(f"{name}: pan, 95th pct", seen.pan_ms(0.95), "ms", "<= 50"),
    ]


def ratios(name: str, peer: Seen, ours: Seen) -> list[Figure]:
    """How many times the peer's figure is ours."""
    return [
        Figure(f"{name} / ours: file", peer.megabytes / ours.megabytes, "times"),
        Figure(f"{name} / ours: all drawn", peer.drawn_ms / ours.drawn_ms, "times"),
        Figure(f"{name} / ours: pan, median", peer.pan_ms(0.5) / ours.pan_ms(0.5), "times"),
    ]


def run(browser: Browser, folder: Path, quick: bool) -> list[Figure]:
    """All pages in one run."""
    count = 10_000 if quick else 100_000
    t, ys = signals(count)
    seconds = count / RATE_HZ
    page, built_s = our_page(folder, t, ys)
    ours = repeated(browser, page, seconds, 1 if quick else 3)
    found = our_figures(f"6 x {count}, {FRAMES} frames", ours, built_s, 1.5)
    for name, make in (("Bokeh", bokeh_page), ("Plotly", plotly_page)):
        with optional_peer(name):
            found += ratios(name, watch(browser, make(folder, t, ys), seconds, PANS // 4), ours)
    if not quick:
        large = folder / "large"
        large.mkdir()
        t, ys = signals(10 * count)
        page, built_s = our_page(large, t, ys)
        found += our_figures(f"6 x {10 * count}", watch(browser, page, 10 * seconds), built_s, 12)
    return found


def main() -> None:
    """Measure and tell; without chromium there is nothing to measure."""
    asked = options(__doc__)
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        sys.stderr.write("report benchmark left out: no chromium on the PATH\n")
        return
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        found = run(browser, Path(folder), asked.quick)
        browser.close()
    tell("Report: 6 plots beside Bokeh and Plotly", found, asked.json)


if __name__ == "__main__":
    main()
