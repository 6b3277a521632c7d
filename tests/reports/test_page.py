"""The page in a real browser: alone, live, readable without script, in print, in the dark."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Locator, Page

from seamlog.reports.report import Report
from seamlog.results import Results
from tests.browsing import Visitor
from tests.reports.sample_results import OFFSET_MM, SLOW_S_MM, write_sample

WIDTH = "#plot-0-bead-stations-width_mm"
ERROR = "#plot-0-tracking-error-error_mm"

NO_FONTS = """
import json
from playwright.sync_api import sync_playwright
from tests.browsing import ARGUMENTS
with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path="{chromium}", args=ARGUMENTS)
    page = browser.new_page(viewport={{"width": {width}, "height": 800}})
    page.goto("{page}")
    page.wait_for_selector("html[data-state]", state="attached")
    print(json.dumps(page.evaluate("[document.documentElement.dataset.state, "
        "document.documentElement.scrollWidth, document.querySelectorAll('canvas').length]")))
    browser.close()
"""


def _hover(page: Page, plot: str, fraction: float) -> None:
    over = page.locator(f"{plot} .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + fraction * box["width"], box["y"] + box["height"] / 2)


def _cursor(page: Page, figure: str) -> float | None:
    text = page.locator(figure).get_attribute("data-cursor")
    return None if text is None else float(text)


def _ink(canvas: Locator) -> int:
    """Pixels of a canvas that something was drawn on."""
    count = canvas.evaluate(
        """canvas => {
            const { width, height } = canvas;
            const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
            let ink = 0;
            for (let i = 3; i < data.length; i += 4) ink += data[i] > 0;
            return ink;
        }"""
    )
    return int(count)


def _seconds_at(sample: Results, s_mm: float) -> float:
    """Report time of a place on the photo, from the join's table."""
    parts = {part.part: part for part in sample.parts()}
    join = sample.columns(parts["join"], "stations")
    origin = sample.columns(parts["identification"], "residual")["stamp_ns"][0]
    return float(np.interp(s_mm - OFFSET_MM, join["s_mm"], (join["stamp_ns"] - origin) / 1e9))


def test_opens_alone_and_live(visitor: Visitor, sample_page: Path) -> None:
    visit = visitor.open(sample_page)
    assert visit.page.locator("html").get_attribute("data-state") == "live"
    loaded = [url for url in visit.requests if not url.startswith("data:")]
    assert loaded == [sample_page.as_uri()]
    assert visit.complaints == []


def test_every_drawing_is_replaced_by_a_live_plot(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page).page
    plots = page.locator("figure.plot")
    assert plots.count() >= 10
    for plot in plots.all():
        assert _ink(plot.locator("canvas")) > 500
        assert plot.locator(".static").is_hidden()


def test_hovering_the_width_moves_time_plots_and_the_photo(
    visitor: Visitor, sample_page: Path, sample: Results
) -> None:
    page = visitor.open(sample_page).page
    _hover(page, WIDTH, 0.4)
    s_mm = _cursor(page, WIDTH)
    assert s_mm is not None and 60 < s_mm < 90
    assert _cursor(page, ERROR) == pytest.approx(_seconds_at(sample, s_mm), abs=0.03)
    assert _cursor(page, "#picture-0-bead-overlay") == pytest.approx(s_mm)
    marker = page.locator("#picture-0-bead-overlay .marker.on line").first
    assert float(marker.get_attribute("x1") or "nan") == pytest.approx(40 + 10 * s_mm)
    assert "mm" in page.locator(f"{ERROR} .now").inner_text()


def test_the_camera_picture_of_the_moment_is_shown(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page).page
    _hover(page, ERROR, 0.5)
    seconds = _cursor(page, ERROR)
    assert seconds is not None
    shown = _cursor(page, "#frames-0-seam")
    assert shown == 30 + 4 * round((seconds - 30) / 4)
    assert page.locator("#frames-0-seam img:visible").count() == 1
    assert _cursor(page, "#moment-0 .seen") == shown
    same = "([a, b]) => document.querySelector(a).src === document.querySelector(b).src"
    images = ["#frames-0-seam img:not([hidden])", "#moment-0 .seen img"]
    assert page.evaluate(same, images)


def test_the_camera_goes_along_when_its_place_is_out_of_sight(
    visitor: Visitor, sample_page: Path
) -> None:
    page = visitor.open(sample_page).page
    assert page.locator("#follow").is_hidden()
    _hover(page, ERROR, 0.5)
    page.locator("#follow").wait_for(state="visible")
    same = "([a, b]) => document.querySelector(a).src === document.querySelector(b).src"
    assert page.evaluate(same, ["#frames-0-seam img:not([hidden])", "#follow img"])
    page.locator("#camera").click()
    page.locator("#follow").wait_for(state="hidden")
    page.locator("#camera").click()
    page.evaluate("scrollTo(0, 0)")
    page.locator("#follow").wait_for(state="hidden")


def test_hovering_the_photo_and_a_time_plot_moves_the_width(
    visitor: Visitor, sample_page: Path, sample: Results
) -> None:
    page = visitor.open(sample_page).page
    stage = page.locator("#picture-0-bead-overlay .stage")
    stage.scroll_into_view_if_needed()
    box = stage.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] * 840 / 2030, box["y"] + box["height"] / 2)
    on_photo = _cursor(page, WIDTH)
    assert on_photo is not None and abs(on_photo - 80) < 12
    _hover(page, ERROR, 0.25)
    seconds, s_mm = _cursor(page, ERROR), _cursor(page, WIDTH)
    assert seconds is not None and s_mm is not None
    assert seconds == pytest.approx(_seconds_at(sample, s_mm), abs=0.05)


def test_a_finding_leads_to_its_place(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page).page
    _hover(page, WIDTH, 0.1)
    page.locator("#verdict a.place").first.click()
    assert _cursor(page, WIDTH) == pytest.approx(SLOW_S_MM + OFFSET_MM, abs=0.2)


def test_arrow_keys_and_slider_move_the_cursor(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page).page
    before = _cursor(page, WIDTH)
    page.locator(f"{WIDTH} .live").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    after = _cursor(page, WIDTH)
    assert before is not None and after == pytest.approx(before + 0.5)
    page.locator("#cursor-place").focus()
    page.keyboard.press("ArrowLeft")
    moved = _cursor(page, WIDTH)
    assert after is not None and moved is not None and moved < after
    assert "width" in page.locator("#cursor-text").inner_text()


def test_zooming_one_time_plot_zooms_the_others(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page).page
    whole = page.locator("#plot-0-tracking-error-command").screenshot()
    _hover(page, ERROR, 0.2)
    page.mouse.down()
    _hover(page, ERROR, 0.4)
    page.mouse.up()
    assert page.locator("#plot-0-tracking-error-command").screenshot() != whole
    page.locator(f"{ERROR} .live").focus()
    page.keyboard.press("Escape")
    _hover(page, ERROR, 0.998)
    assert _cursor(page, ERROR) == pytest.approx(63.96, abs=0.1)


def test_without_script_verdict_and_drawings_are_there(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page, java_script_enabled=False).page
    assert "FAIL" in page.locator(".banner .word").inner_text()
    drawings = page.locator("figure.plot .static svg")
    assert drawings.count() == page.locator("figure.plot").count()
    assert all(drawing.is_visible() for drawing in drawings.all())
    assert page.locator("#cursor").is_hidden() and page.locator("#theme").is_hidden()


def test_print_shows_drawings_and_no_controls(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page, color_scheme="dark").page
    page.emulate_media(media="print")
    assert page.locator(f"{WIDTH} .static svg").is_visible()
    assert page.locator(f"{WIDTH} .live").is_hidden()
    assert page.locator("#cursor").is_hidden()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.pdf(format="A4").startswith(b"%PDF")


def test_dark_by_the_system_and_by_the_button(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page, color_scheme="dark").page
    background = "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(background)
    plot = page.locator(f"{WIDTH} canvas")
    before = plot.evaluate("canvas => canvas.toDataURL()")
    page.locator("#theme").click()
    assert page.evaluate(background) == "rgb(255, 255, 255)" != dark
    page.wait_for_function(
        "before => document.querySelector(before[0]).toDataURL() !== before[1]",
        arg=[f"{WIDTH} canvas", before],
    )


@pytest.mark.parametrize("width", [1280, 390])
def test_without_any_font_the_layout_holds(
    sample_page: Path, chromium: str, tmp_path: Path, width: int
) -> None:
    """A machine without the fonts asked for: the words may be boxes, the page stays in shape."""
    (tmp_path / "fonts.conf").write_text("<fontconfig><cachedir>/nowhere</cachedir></fontconfig>")
    fonts = {"FONTCONFIG_FILE": str(tmp_path / "fonts.conf")}
    # In a process of its own: playwright runs one browser driver per thread.
    script = NO_FONTS.format(chromium=chromium, page=sample_page.as_uri(), width=width)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=os.environ | fonts
    )
    assert done.returncode == 0, done.stderr
    state, wide, plots = json.loads(done.stdout)
    assert (state, wide <= width) == ("live", True)
    assert plots >= 10


def test_phone_width_does_not_scroll_sideways(visitor: Visitor, sample_page: Path) -> None:
    page = visitor.open(sample_page, viewport={"width": 390, "height": 844}).page
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_without_a_join_the_photo_says_nothing_about_time(visitor: Visitor, tmp_path: Path) -> None:
    results = write_sample(tmp_path / "results")
    (tmp_path / "results" / "join.json").unlink()
    report = Report()
    report.add_results(results)
    report.write(tmp_path / "report.html")
    page = visitor.open(tmp_path / "report.html").page
    _hover(page, ERROR, 0.5)
    _hover(page, WIDTH, 0.5)
    assert _cursor(page, WIDTH) is not None
    assert _cursor(page, ERROR) is None
    assert "t =" not in page.locator("#cursor-text").inner_text()
