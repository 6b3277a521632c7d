"""The whole chain, as a person runs it: `seamlog demo`, then its files in other readers."""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from playwright.sync_api import Page
from rosbags.highlevel import AnyReader

from seamlog import open_session
from seamlog.results import Columns, Results
from tests.browsing import Visitor


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo")
    words = [sys.executable, "-m", "seamlog", "demo", "-o", str(folder), "--json"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=110, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["planted_cause_found"] is True
    return folder


@pytest.fixture(scope="module")
def counts(demo: Path) -> dict[str, int]:
    with open_session(demo / "weld.mcap") as session:
        return {topic: channel.count for topic, channel in session.info.channels.items()}


def test_nothing_is_missing_from_the_session(demo: Path, counts: dict[str, int]) -> None:
    with open_session(demo / "weld.mcap") as session:
        assert session.info.problems == []
        assert len(session.info.welds) == 1
        assert any(name.startswith("photo/") for name in session.attachments)
    assert min(counts.values()) > 0


def test_mcap_reads_the_session(demo: Path, counts: dict[str, int]) -> None:
    with (demo / "weld.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = Counter(channel.topic for _, channel, _ in reader.iter_messages())
        assert found == counts
        assert [item.name for item in reader.iter_attachments()]


def test_rosbags_decodes_the_session(demo: Path, counts: dict[str, int]) -> None:
    found: Counter[str] = Counter()
    with AnyReader([demo / "weld.mcap"]) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            found[connection.topic] += 1
    assert found == counts


def test_the_javascript_reader_reads_the_session(
    demo: Path, counts: dict[str, int], node: str, node_modules: Path, project: Path
) -> None:
    assert node_modules.is_dir()
    script = project / "tests" / "js" / "read_mcap.mjs"
    words = [node, str(script), str(demo / "weld.mcap")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    assert {topic: seen["count"] for topic, seen in document["topics"].items()} == counts


def test_replayed_outputs_stand_beside_the_originals(demo: Path, counts: dict[str, int]) -> None:
    with open_session(demo / "replay.mcap") as session:
        channels = session.info.channels
        assert all(channels[topic].count == count for topic, count in counts.items())
        assert any(topic.startswith("/replay/paper/") for topic in channels)
        assert any(topic.startswith("/replay/pd/") for topic in channels)


def test_every_part_is_there(demo: Path) -> None:
    parts = {part.part for part in Results.open(demo / "weld.results").parts()}
    assert {"health", "tracking", "seam", "identification", "replay", "bead", "join"} <= parts


def test_the_report_opens_from_disk_without_a_request(demo: Path, visitor: Visitor) -> None:
    report = demo / "report.html"
    visit = visitor.open(report)
    visit.page.wait_for_selector(".uplot canvas")
    assert [url for url in visit.requests if url != report.as_uri()] == []
    assert visit.complaints == []
    text = visit.page.inner_text("body")
    assert "FAIL" in text and "weld speed" in text


def test_hovering_the_wide_place_shows_its_frame_and_its_tracking_error(
    demo: Path, visitor: Visitor
) -> None:
    """The product in one gesture: a place on the photo, its picture, its moment in the log."""
    results = Results.open(demo / "weld.results")
    parts = {part.part: part for part in results.parts()}
    with open_session(demo / "weld.mcap") as session:
        planted = json.loads(session.metadata["seamlog.truth"]["json"])["planted_cause"]
    join = results.columns(parts["join"], "stations")
    place = int(np.argmin(np.abs(join["s_mm"] - planted["s_mm"])))
    moment_ns = int(join["stamp_ns"][place])
    bead = results.columns(parts["bead"], "stations")
    on_photo = join["s_mm"][place] + parts["join"].details["offset_mm"]
    station = int(np.argmin(np.abs(bead["s_mm"] - on_photo)))

    page = visitor.open(demo / "report.html").page
    _hover_photo(page, parts["bead"].details, bead, station)
    times = [p.time_ns for p in parts["seam"].pictures.values() if p.time_ns is not None]
    nearest_ns = min(times, key=lambda time_ns: abs(time_ns - moment_ns))
    error = results.columns(parts["tracking"], "error")
    origin_ns = _origin_ns(results)
    shown_s = float(page.locator("#moment-0 .seen").get_attribute("data-cursor") or "nan")
    assert shown_s == pytest.approx((nearest_ns - origin_ns) / 1e9, abs=0.31)
    plot = page.locator("#plot-0-tracking-error-error_mm")
    at_s = float(plot.get_attribute("data-cursor") or "nan")
    assert at_s == pytest.approx((moment_ns - origin_ns) / 1e9, abs=0.3)
    row = int(np.argmin(np.abs((error["stamp_ns"] - origin_ns) / 1e9 - at_s)))
    told = plot.locator(".now").first.inner_text().replace("−", "-")
    assert float(told.split()[0]) == pytest.approx(float(error["error_mm"][row]), abs=0.01)


def _hover_photo(page: Page, details: dict[str, Any], bead: Columns, station: int) -> None:
    stage = page.locator("#picture-0-bead-overlay .stage")
    stage.scroll_into_view_if_needed()
    box = stage.locator(".marker").bounding_box()
    assert box is not None
    scale = min(
        box["width"] / details["photo_width_px"], box["height"] / details["photo_height_px"]
    )
    left = box["x"] + (box["width"] - scale * details["photo_width_px"]) / 2
    top = box["y"] + (box["height"] - scale * details["photo_height_px"]) / 2
    x = (bead["left_x_px"][station] + bead["right_x_px"][station]) / 2
    y = (bead["left_y_px"][station] + bead["right_y_px"][station]) / 2
    page.mouse.move(left + scale * float(x), top + scale * float(y))


def _origin_ns(results: Results) -> int:
    """Zero of the report's time: the first stamp of any table but the join's."""
    return min(
        int(np.nanmin(results.columns(part, name)["stamp_ns"]))
        for part in results.parts()
        for name, table in part.tables.items()
        if part.part != "join" and "stamp_ns" in table.columns
    )
