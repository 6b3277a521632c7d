"""`seamlog record` and `seamlog sources`, with sources of another distribution."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.recorder.sessions import read_metadata, read_session

SOURCES = '''
import time
from pydantic import BaseModel, ConfigDict, Field
from seamlog.clock import MonotonicClock, SimulatedClock
from seamlog.contracts import SourceResult
from seamlog.errors import SourceMissing


class Table:
    """A table that moves for a while, in simulated time."""

    class Config(BaseModel):
        model_config = ConfigDict(extra="forbid")
        count: int = Field(500, gt=0)
        period_s: float = Field(0.01, gt=0)

    pace = "simulated"

    def __init__(self, config):
        self.config = config
        self.clock = SimulatedClock()

    def run(self, sink):
        encoder = sink.channel("/table/encoder", {"encoder": "virtual"})
        sink.add_metadata("seamlog.truth", {"json": "{}"})
        for i in range(self.config.count):
            self.clock.advance_to(self.clock.now_ns() + round(self.config.period_s * 1e9))
            encoder.put(self.clock.now_ns(), i, 0.0)
        return SourceResult({"bead.jpg": b"picture"})


class Endless(Table):
    """A live table that nobody stops."""

    pace = "paced"

    def __init__(self, config):
        self.clock = MonotonicClock()

    def run(self, sink):
        encoder = sink.channel("/table/encoder")
        while True:
            encoder.put(time.time_ns(), 1.0, 2.0)
            print("running", flush=True)
            time.sleep(0.01)


class Wrong(Endless):
    def run(self, sink):
        sink.channel("/table/encoder").put(-1, 0.0, 0.0)
        return SourceResult()


class Unplugged(Endless):
    def run(self, sink):
        raise SourceMissing("no encoder at /dev/ttyUSB0; plug it in")


class Dying(Endless):
    def run(self, sink):
        sink.channel("/table/encoder").put(1, 0.0, 0.0)
        raise SourceMissing("the encoder went away")
'''
ENTRIES = """
[seamlog.sources]
table = lab_sources:Table
endless = lab_sources:Endless
wrong = lab_sources:Wrong
unplugged = lab_sources:Unplugged
dying = lab_sources:Dying
broken = lab_sources_missing:Nothing
"""


class Lab:
    """A folder in which `seamlog` finds the sources above."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / "weld.mcap"
        site = folder / "site"
        facts = site / "lab-1.0.dist-info"
        facts.mkdir(parents=True)
        (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n")
        (facts / "entry_points.txt").write_text(ENTRIES)
        (site / "lab_sources.py").write_text(textwrap.dedent(SOURCES))
        self.environment = os.environ | {"PYTHONPATH": str(site)}

    def start(self, *arguments: str) -> "subprocess.Popen[str]":
        command = [sys.executable, "-m", "seamlog", *arguments]
        pipe = subprocess.PIPE
        return subprocess.Popen(
            command, stdout=pipe, stderr=pipe, text=True, env=self.environment, cwd=self.folder
        )

    def run(self, *arguments: str) -> tuple[int, str, str]:
        process = self.start(*arguments)
        output, errors = process.communicate(timeout=60)
        assert "Traceback" not in errors
        return process.returncode, output, errors

    def record(self, source: str, *more: str) -> tuple[int, str, str]:
        return self.run("record", "--source", source, "-o", "weld.mcap", *more)


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    yield Lab(tmp_path)


def test_a_source_becomes_a_session(lab: Lab) -> None:
    code, output, _ = lab.record("table", "--meta", "part=bracket 7", "--set", "source.count=300")
    assert code == 0
    assert "300 messages" in output
    assert "Complete" in output
    assert "survives loss of power" in output
    messages = read_session(lab.path)["/table/encoder"]
    assert [m.values[0] for m in messages] == list(range(300))
    metadata = read_metadata(lab.path)
    assert metadata["seamlog.recording"]["part"] == "bracket 7"
    assert metadata["seamlog.recording"]["pace"] == "simulated"
    assert metadata["seamlog.truth"] == {"json": "{}"}
    assert (lab.folder / "weld.bead.jpg").read_bytes() == b"picture"


def test_the_document(lab: Lab) -> None:
    code, output, _ = lab.record("table", "--json")
    document = json.loads(output)
    assert code == 0
    assert document["schema"] == "seamlog.record"
    assert document["complete"]
    assert document["ended"] == "the source ended"
    (channel,) = document["channels"]
    assert (channel["topic"], channel["written"]) == ("/table/encoder", 500)
    assert channel["longest_gap_s"] == pytest.approx(0.01)
    assert document["files"] == ["weld.bead.jpg"]


def test_an_interrupt_ends_the_recording_and_finishes_the_file(lab: Lab) -> None:
    process = lab.start("record", "--source", "endless", "-o", "weld.mcap")
    assert process.stdout is not None
    for _ in range(20):
        process.stdout.readline()
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "Traceback" not in errors
    assert "interrupted" in output
    assert len(read_session(lab.path)["/table/encoder"]) >= 20


def test_a_duration_ends_a_live_source(lab: Lab) -> None:
    code, output, _ = lab.record("endless", "--duration", "0.2")
    assert code == 0
    assert "the duration is over" in output
    assert len(read_session(lab.path)["/table/encoder"]) > 3


def test_a_duration_of_simulated_time(lab: Lab) -> None:
    code, _, _ = lab.record("table", "--duration", "2")
    assert code == 0
    assert len(read_session(lab.path)["/table/encoder"]) == 200


def test_realtime_holds_a_simulated_source_to_the_clock(lab: Lab) -> None:
    begin = time.monotonic()
    code, _, _ = lab.record("table", "--pace", "realtime", "--set", "source.count=80")
    assert code == 0
    assert time.monotonic() - begin > 0.79
    assert read_metadata(lab.path)["seamlog.recording"]["pace"] == "paced"


def test_messages_that_were_turned_away_are_a_finding(lab: Lab) -> None:
    code, output, _ = lab.record("wrong")
    assert code == 1
    assert "INCOMPLETE: 0 dropped, 1 refused" in output


def test_a_source_that_is_not_there_leaves_nothing_behind(lab: Lab) -> None:
    code, _, errors = lab.record("unplugged")
    assert code == 4
    assert "plug it in" in errors
    assert [path.name for path in lab.folder.iterdir()] == ["site"]


def test_a_source_that_dies_leaves_what_it_had_logged(lab: Lab) -> None:
    code, _, errors = lab.record("dying")
    assert code == 4
    assert "went away" in errors
    assert len(read_session(lab.path)["/table/encoder"]) == 1


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        ("--source tabel -o weld.mcap", 2, "Did you mean 'table'?"),
        ("--source table -o missing/weld.mcap", 3, "does not exist"),
        ("--source table -o weld.mcap --meta part", 2, "key=value"),
        ("--source table -o weld.mcap --meta id=1", 2, "writes these itself"),
        ("--source table -o weld.mcap --duration 0", 2, "duration"),
        ("--source table -o weld.mcap --set source.count=0 --set source.cout=1", 2, "2 faults"),
    ],
)
def test_bad_requests(lab: Lab, arguments: str, code: int, said: str) -> None:
    found, _, errors = lab.run("record", *arguments.split())
    assert (found, said in errors) == (code, True), errors
    assert [path.name for path in lab.folder.iterdir()] == ["site"]


def test_an_existing_session_needs_force(lab: Lab) -> None:
    lab.path.write_bytes(b"precious")
    code, _, errors = lab.record("table")
    assert code == 2
    assert "--force" in errors
    assert lab.path.read_bytes() == b"precious"
    assert lab.record("table", "--force")[0] == 0


def test_sources_says_what_can_be_recorded(lab: Lab) -> None:
    code, output, _ = lab.run("sources")
    assert code == 0
    lines = {line.split()[0]: line for line in output.splitlines()}
    assert "simulated" in lines["table"]
    assert "available" in lines["table"]
    assert "paced" in lines["endless"]
    assert "lab_sources_missing" in lines["broken"]
    for arguments in (["sources", "--json"], ["sources", "list", "--json"]):
        rows: list[dict[str, Any]] = json.loads(lab.run(*arguments)[1])["sources"]
        assert {row["name"]: row["available"] for row in rows}["broken"] is False


def test_a_clean_recording_is_compacted_on_demand(lab: Lab) -> None:
    code, output, _ = lab.record("table", "--compact", "--set", "source.count=300")
    assert code == 0
    assert "weld.compact.mcap: in large chunks" in output
    one, other = (read_session(lab.folder / name) for name in ("weld.mcap", "weld.compact.mcap"))
    assert one["/table/encoder"] == other["/table/encoder"]
    code, _, errors = lab.record("table", "--compact")
    assert code == 2
    assert "there already" in errors


def test_how_a_recording_is_kept_is_chosen_by_options(lab: Lab) -> None:
    code, output, _ = lab.record("table", "--sync", "eco", "--budget", "20 GiB", "--json")
    assert code == 0
    document = json.loads(output)
    assert document["segments"] == [str(lab.path)]
    assert "within 5.1 s" in document["acknowledgement"]["durable"]


def test_a_snapshot_by_a_rule(lab: Lab) -> None:
    rule = "/table/encoder.position_m >= 400 m"
    code, output, _ = lab.record("table", "--snapshot", "1+0.5", "--trigger", rule)
    assert code == 0, output
    assert "messages were discarded" in output
    values = [m.values[0] for m in read_session(lab.path)["/table/encoder"]]
    assert values == [float(n) for n in range(300, 500)]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--segment-size", "much"), "500MB or 20GiB"),
        (("--segment-size", "10 KB"), "at least 1 MiB"),
        (("--budget", "1MiB"), "at least 4 MiB"),
        (("--snapshot", "ten"), "10+5"),
        (("--trigger", "error > 1 mm"), "--snapshot"),
        (("--snapshot", "10+5", "--trigger", "error > 1"), "say the unit"),
        (("--snapshot", "-1"), "some time before"),
    ],
)
def test_options_that_make_no_sense(lab: Lab, options: tuple[str, ...], words: str) -> None:
    code, _, errors = lab.record("table", *options)
    assert code == 2
    assert words in errors
    assert not list(lab.folder.glob("*.mcap*"))
