"""The report in Firefox ESR: alone, live, with its cursor, without a word on the console."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import missing
from tests.firefox import Firefox, firefox
from tests.reports.sample_results import OFFSET_MM, SLOW_S_MM

READY = """new Promise(done => {
    const look = () => document.documentElement.dataset.state
        ? done(document.documentElement.dataset.state) : setTimeout(look, 20);
    look();
})"""
LEAST_INK = """Math.min(...Array.from(document.querySelectorAll("figure.plot canvas"), canvas => {
    const { width, height } = canvas;
    const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
    let ink = 0;
    for (let i = 3; i < data.length; i += 4) ink += data[i] > 0;
    return ink;
}))"""


@pytest.fixture(scope="module")
def page(sample_page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Firefox]:
    binary = shutil.which("firefox-esr") or shutil.which("firefox")
    if binary is None:
        missing("firefox", "no firefox on the PATH; install Debian's package firefox-esr")
    with firefox(binary, tmp_path_factory.mktemp("profile")) as opened:
        opened.open(sample_page)
        assert opened.evaluate(READY) == "live"
        yield opened


def test_opens_alone_and_without_a_complaint(page: Firefox, sample_page: Path) -> None:
    loaded = [url for url in page.requests() if not url.startswith(("data:", "about:"))]
    assert set(loaded) <= {sample_page.as_uri()}
    assert page.complaints() == []


def test_every_plot_is_drawn(page: Firefox) -> None:
    assert page.evaluate("document.querySelectorAll('figure.plot canvas').length") >= 10
    assert page.evaluate(LEAST_INK) > 500


def test_the_cursor_ties_photo_width_time_and_camera(page: Firefox) -> None:
    at = SLOW_S_MM + OFFSET_MM
    page.evaluate(f"seamlog.show('0/photo/1', {at})")
    ids = ("plot-0-bead-stations-width_mm", "plot-0-tracking-error-error_mm", "frames-0-seam")
    width, error, frame = (
        float(page.evaluate(f"document.getElementById('{name}').dataset.cursor")) for name in ids
    )
    assert width == pytest.approx(at, abs=0.2)
    assert error == pytest.approx(50.5, abs=0.3)
    assert frame == pytest.approx(error, abs=2.1)
    assert "width" in page.evaluate("document.getElementById('cursor-text').textContent")


def test_zoom_reaches_every_axis(page: Firefox) -> None:
    page.evaluate("seamlog.zoom('0/time', 45, 55)")
    assert page.evaluate("document.getElementById('zoom-all').disabled") is False
    page.evaluate("seamlog.whole()")
