"""The whole chain, as a person runs it: `seamlog demo`, then its files in other readers."""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from seamlog import open_session
from seamlog.results import Results
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
    assert {"health", "tracking", "identification", "replay", "bead", "join"} <= parts


def test_the_report_opens_from_disk_without_a_request(demo: Path, visitor: Visitor) -> None:
    report = demo / "report.html"
    visit = visitor.open(report)
    visit.page.wait_for_selector(".uplot canvas")
    assert [url for url in visit.requests if url != report.as_uri()] == []
    assert visit.complaints == []
    text = visit.page.inner_text("body")
    assert "FAIL" in text and "weld speed" in text
