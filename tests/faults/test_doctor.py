"""`seamlog doctor` finds each planted fault, at its place, and nothing in what is whole."""

import json
import os
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from zlib_ng.zlib_ng import crc32

from seamlog import open_session
from seamlog.cli import run
from seamlog.mcap import records
from seamlog.recorder import Recorder, Snapshot
from seamlog.recorder.recovery import recover
from seamlog.recorder.storage import Storage
from tests.core.scenarios import SCENARIOS, picture, write_live
from tests.recorder.test_snapshot import SimulatedLoop, run_in_parts

Document = dict[str, Any]
Examine = Callable[[Path], Document]


@pytest.fixture
def examine(capsys: pytest.CaptureFixture[str]) -> Examine:
    def examine(path: Path) -> Document:
        before = path.read_bytes()
        capsys.readouterr()
        code = run(["doctor", str(path), "--json"])
        assert path.read_bytes() == before
        document: Document = json.loads(capsys.readouterr().out)
        notes = [row for row in document["findings"] if row["severity"] == "note"]
        assert code == (0 if len(notes) == len(document["findings"]) else 1)
        return document

    return examine


def ids(document: Document) -> set[str]:
    return {row["id"] for row in document["findings"] if row["severity"] != "note"}


def finding(document: Document, name: str) -> Document:
    (row,) = [row for row in document["findings"] if row["id"] == name]
    assert row["cause"]
    assert row["action"]
    return dict(row)


@pytest.fixture
def live(tmp_path: Path) -> Path:
    write_live(tmp_path / "x.mcap")
    return tmp_path / "x.mcap"


def change(path: Path, place: int, new: bytes) -> None:
    data = path.read_bytes()
    path.write_bytes(data[:place] + new + data[place + len(new) :])


def chunk_entries(path: Path) -> list[records.ChunkEntry]:
    with open_session(path) as session:
        return list(session.files[0].index.chunks)


def resign(path: Path, act: Callable[[bytearray], None]) -> None:
    """Change the summary and give it a CRC that fits."""
    data = path.read_bytes()
    end = len(data) - len(records.MAGIC)
    (start,) = struct.unpack_from("<Q", data, end - 20)
    summary = bytearray(data[start : end - 4])
    act(summary)
    path.write_bytes(data[:start] + summary + struct.pack("<I", crc32(summary)) + records.MAGIC)


@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_nothing_is_found_in_whole_files(tmp_path: Path, examine: Examine, name: str) -> None:
    SCENARIOS[name](tmp_path / "x.mcap")
    assert ids(examine(tmp_path / "x.mcap")) == set()


def test_a_damaged_chunk(live: Path, examine: Examine) -> None:
    entry = chunk_entries(live)[3]
    change(live, live.read_bytes().index(picture(1)) + 20, b"?")
    row = finding(examine(live), "chunk-damaged")
    assert (row["offset"], row["length"]) == (entry.offset, entry.length)
    assert (row["start_ns"], row["end_ns"]) == (entry.start_ns, entry.end_ns)
    assert "1 of /camera/image" in row["cause"]
    assert "CRC" in row["cause"]


def test_a_damaged_attachment(live: Path, examine: Examine) -> None:
    change(live, live.read_bytes().rindex(picture(3)) + 30, b"?")
    assert ids(examine(live)) == {"attachment-crc"}


def test_a_damaged_summary(live: Path, examine: Examine) -> None:
    change(live, live.stat().st_size - 60, b"???")
    assert ids(examine(live)) == {"summary-damaged"}


def test_an_unfinished_file(live: Path, examine: Examine) -> None:
    live.write_bytes(live.read_bytes()[: chunk_entries(live)[-1].offset + 20])
    document = examine(live)
    assert ids(document) == {"unfinished", "bytes-lost"}
    assert finding(document, "bytes-lost")["length"] == 20
    assert not document["is_whole"]


def test_a_chunk_with_wrong_times(live: Path, examine: Examine) -> None:
    entry = chunk_entries(live)[2]
    change(live, entry.offset + 9, bytes(8))
    found = ids(examine(live))
    assert "chunk-times" in found


def test_a_wrong_message_index(live: Path, examine: Examine) -> None:
    (at,) = chunk_entries(live)[0].index_offsets.values()
    change(live, at + 15 + 8, b"\x07")
    row = finding(examine(live), "message-index")
    assert row["offset"] == at
    assert row["topic"] == "/table/encoder"


def test_a_chunk_that_no_index_lists(live: Path, examine: Examine) -> None:
    entry = chunk_entries(live)[1]

    def leave_out(summary: bytearray) -> None:
        whole = records.chunk_index(entry)
        at = summary.index(whole)
        summary[at : at + len(whole)] = records.record(200, bytes(len(whole) - 9))

    resign(live, leave_out)
    document = examine(live)
    assert finding(document, "chunk-index")["offset"] == entry.offset


def test_statistics_that_do_not_count(live: Path, examine: Examine) -> None:
    with open_session(live) as session:
        count = session.info.message_count

    def count_more(summary: bytearray) -> None:
        at = summary.index(struct.pack("<Q", count))
        summary[at : at + 8] = struct.pack("<Q", count + 5)

    resign(live, count_more)
    assert f"{count + 5} messages" in finding(examine(live), "statistics")["cause"]


def test_the_crc_over_all_data(tmp_path: Path, examine: Examine) -> None:
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        writer = Writer(file, enable_data_crcs=True, use_chunking=False)
        writer.start("ros2", "test")
        channel = writer.register_channel("/a", "json", 0)
        for time in range(20):
            writer.add_message(channel, time, b'{"level": 1}', time, time)
        writer.finish()  # type: ignore[no-untyped-call]
    assert ids(examine(path)) == set()
    change(path, path.read_bytes().index(b'"level"') + 1, b"L")
    assert ids(examine(path)) == {"data-crc"}


def test_drops_gaps_and_steps_of_a_recording(tmp_path: Path, examine: Examine) -> None:
    path = tmp_path / "weld.mcap"
    with Recorder(path, strict=False) as recorder:
        encoder = recorder.channel("/table/encoder")
        start = recorder.clock.now_ns()
        for place in range(200):
            late = 5_000_000_000 if place >= 100 else 0
            encoder.put(start + late, float(place), 0.0)
        encoder.put(-1, 0.0, 0.0)
        recorder.log_frame("/camera/image", np.zeros((8, 8), np.uint8))
    document = examine(path)
    assert ids(document) == {"refused", "clock-step"}
    assert "+5.0" in finding(document, "clock-step")["cause"]
    assert finding(document, "refused")["topic"] == "/table/encoder"


def test_a_session_that_is_being_recorded(tmp_path: Path, examine: Examine) -> None:
    partial = tmp_path / "weld.mcap.part"
    with Recorder(tmp_path / "weld.mcap") as recorder:
        encoder = recorder.channel("/table/encoder")
        for place in range(100):
            encoder.put(recorder.clock.now_ns(), float(place), 0.0)
        while not recorder.status().channels[0].written:
            time.sleep(0.01)
        assert run(["doctor", str(partial)]) == 0
    assert ids(examine(tmp_path / "weld.mcap")) == set()


def test_gaps_between_snapshots_are_no_fault(tmp_path: Path, examine: Examine) -> None:
    loop = SimulatedLoop(tmp_path / "weld.mcap", Snapshot(0.5, 0.5))
    for _ in range(3):
        run_in_parts(loop, 300)
        loop.events.put(loop.step, 3, "fault")
        run_in_parts(loop, 200)
    loop.close()
    document = examine(tmp_path / "weld.mcap")
    # The stamps of this loop count steps and are no times.
    assert ids(document) <= {"clock-step"}
    assert any("part of no snapshot" in row["cause"] for row in document["findings"])
    assert recover(tmp_path / "weld.mcap").is_complete


def test_a_file_of_the_row_is_missing(tmp_path: Path, examine: Examine) -> None:
    session, storage = tmp_path / "weld.mcap", Storage(segment_bytes=1 << 20)
    with Recorder(session, pace="simulated", storage=storage) as recorder:
        points = recorder.channel("/seam/points")
        for stamp in range(120):
            values = struct.unpack("<4000q", os.urandom(32_000))
            points.put(stamp, [float(value) for value in values], [1.0])
    assert ids(examine(session)) == set()
    (tmp_path / "weld.0002.mcap").unlink()
    document = examine(session)
    assert "file 2" in finding(document, "file-missing")["cause"]
    assert {"messages-missing", "sequence-gap"} <= ids(document)


def test_messages_that_are_missing_between(live: Path, examine: Examine, tmp_path: Path) -> None:
    path = tmp_path / "gap.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        channel = writer.register_channel("/a", "json", 0)
        for sequence in (*range(50), *range(57, 90)):
            writer.add_message(channel, sequence, b"{}", sequence, sequence)
        writer.finish()  # type: ignore[no-untyped-call]
    row = finding(examine(path), "sequence-gap")
    assert "7 messages" in row["cause"]
    assert (row["start_ns"], row["end_ns"]) == (49, 57)


def test_people_get_place_cause_and_what_to_do(
    live: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change(live, live.read_bytes().index(picture(1)) + 20, b"?")
    assert run(["doctor", str(live)]) == 1
    text = capsys.readouterr().out
    assert "chunk-damaged" in text
    assert "do: 'seamlog recover'" in text
    assert "2026-01-01" in text


@pytest.mark.parametrize(("content", "code"), [(b"", 3), (b"PK\x03\x04" * 9, 3)])
def test_what_is_no_session(tmp_path: Path, content: bytes, code: int) -> None:
    (tmp_path / "x.mcap").write_bytes(content)
    assert run(["doctor", str(tmp_path / "x.mcap")]) == code
    assert run(["recover", str(tmp_path / "x.mcap")]) == code
    assert run(["recover", str(tmp_path / "none.mcap")]) == 3
