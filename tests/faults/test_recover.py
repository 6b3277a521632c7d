"""`seamlog recover`: what it keeps, what it says, and what it never does."""

import json
import os
import struct
from pathlib import Path

import numpy as np
import pytest

from seamlog import open_session
from seamlog.cli import run
from seamlog.errors import OutputExists, SessionError, UsageError
from seamlog.mcap import parsing, records
from seamlog.mcap.chunks import read_chunk
from seamlog.mcap.records import ChunkEntry
from seamlog.recorder import Recorder
from seamlog.recorder.recovery import recover
from seamlog.recorder.storage import Storage
from tests.core.scenarios import picture, write_foreign, write_live
from tests.recorder.sessions import read_attachments, read_metadata, read_session


@pytest.fixture
def live(tmp_path: Path) -> Path:
    write_live(tmp_path / "x.mcap")
    return tmp_path / "x.mcap"


def entries(path: Path) -> list[ChunkEntry]:
    with open_session(path) as session:
        return list(session.files[0].index.chunks)


def crcs(path: Path) -> list[tuple[int, bytes]]:
    """CRC and content of each chunk."""
    found = []
    with open_session(path) as session:
        file = session.files[0]
        for entry in file.index.chunks:
            content = file.source.content(entry.offset, entry.length, records.CHUNK)
            crc = parsing.parse_chunk_head(content).crc
            found.append((crc, bytes(read_chunk(file.source, entry, session.limits))))
    return found


def test_proved_chunks_keep_their_crc_and_the_rest_its_place(live: Path) -> None:
    data = bytearray(live.read_bytes())
    data[data.index(picture(1)) + 20] ^= 1
    live.write_bytes(data)
    found = recover(live)
    assert found.output == live.with_name("x.recovered.mcap")
    assert live.read_bytes() == data
    before, after = crcs_of_whole(live), crcs(found.output)
    assert after == before
    lost = {row.topic: row.lost for row in found.channels}
    assert lost == {"/table/encoder": 0, "/camera/image": 1}
    assert read_attachments(found.output)["photo/a.jpg"][1] == picture(3)
    assert read_metadata(found.output)["seamlog.recording"]["id"] == "test"
    with open_session(found.output) as session:
        assert any("1 lost" in text for text in session.problems)


def crcs_of_whole(path: Path) -> list[tuple[int, bytes]]:
    from seamlog.mcap.records import Malformed

    found = []
    with open_session(path) as session:
        file = session.files[0]
        for entry in file.index.chunks:
            content = file.source.content(entry.offset, entry.length, records.CHUNK)
            try:
                whole = bytes(read_chunk(file.source, entry, session.limits))
            except Malformed:
                continue
            found.append((parsing.parse_chunk_head(content).crc, whole))
    return found


def test_a_damaged_attachment_is_left_out_and_said(live: Path) -> None:
    data = bytearray(live.read_bytes())
    data[data.rindex(picture(3)) + 30] ^= 1
    live.write_bytes(data)
    found = recover(live)
    assert not found.is_complete
    assert any("photo/a.jpg" in text for text in found.problems)
    assert read_attachments(found.output) == {}


@pytest.mark.parametrize("compression", ["zstd", "lz4", ""])
@pytest.mark.parametrize("zeros", [0, 5000])
def test_the_open_tail_of_a_cut_file(tmp_path: Path, compression: str, zeros: int) -> None:
    from mcap.writer import CompressionType

    kinds = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "": CompressionType.NONE}
    options = {"chunk_size": 300_000, "compression": kinds[compression]}
    path = tmp_path / "x.mcap"
    write_foreign(path, options, 6000)
    with open_session(path) as session:
        whole = {topic: session.columns(topic) for topic in ("/table/encoder", "/status")}
    last = entries(path)[-2]
    cut = last.offset + last.length * 9 // 10
    path.write_bytes(path.read_bytes()[:cut] + bytes(zeros))
    with open_session(path) as session:
        read = session.info.message_count
    found = recover(path)
    kept = sum(row.kept for row in found.channels)
    assert kept > read
    assert sum(row.unproved for row in found.channels) == kept - read
    assert crcs(found.output)[-1][0] == 0
    with open_session(found.output) as session:
        for topic, columns in whole.items():
            mine = session.columns(topic)
            for name, column in mine.items():
                assert column.tolist() == columns[name][: len(column)].tolist()


def test_messages_outside_chunks_stay_unsigned(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    expected = write_foreign(path, {"use_chunking": False}, 200)
    path.write_bytes(path.read_bytes()[:-300])
    found = recover(path)
    assert all(row.unproved == row.kept for row in found.channels)
    assert {crc for crc, _ in crcs(found.output)} == {0}
    with open_session(found.output) as session:
        columns = session.columns("/table/encoder")
    count = len(columns["stamp_ns"])
    assert count > 150
    expected_m = np.asarray(expected["/table/encoder"]["position_m"])[:count]
    np.testing.assert_array_equal(columns["position_m"], expected_m)


def test_a_cut_between_two_chunks_is_no_success(live: Path) -> None:
    entry = entries(live)[6]
    live.write_bytes(live.read_bytes()[: entry.offset])
    found = recover(live)
    assert not found.has_losses
    assert not found.end_known
    assert not found.is_complete
    assert run(["recover", str(live), "--force"]) == 1


def test_a_foreign_recording_keeps_its_profile(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    write_foreign(path, {}, 300)
    path.write_bytes(path.read_bytes()[:-2000])
    with open_session(recover(path).output) as session:
        assert session.files[0].index.profile == "ros2"


def test_the_last_file_of_a_recording(tmp_path: Path) -> None:
    session = tmp_path / "weld.mcap"
    with Recorder(session, pace="simulated", storage=Storage(segment_bytes=1 << 20)) as recorder:
        points = recorder.channel("/seam/points")
        for stamp in range(120):
            values = struct.unpack("<4000q", os.urandom(32_000))
            assert points.put(stamp, [float(value) for value in values], [1.0])
    last = sorted(tmp_path.glob("weld.*.mcap"))[-1]
    partial = last.with_name(last.name + ".part")
    partial.write_bytes(last.read_bytes()[:-200])
    whole = last.read_bytes()
    last.unlink()
    found = recover(last)
    assert (found.source, found.output) == (partial, last)
    assert found.is_complete
    assert last.stat().st_size == pytest.approx(len(whole), abs=2000)
    messages = [len(read_session(path)["/seam/points"]) for path in tmp_path.glob("weld*.mcap")]
    assert sum(messages) == 120


def test_what_it_refuses(live: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="never changed"):
        recover(live, live, force=True)
    (tmp_path / "y.mcap").write_bytes(b"old")
    with pytest.raises(OutputExists):
        recover(live, tmp_path / "y.mcap")
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    with pytest.raises(SessionError, match="nothing to recover"):
        recover(empty)
    assert not (tmp_path / "empty.recovered.mcap").exists()
    with Recorder(tmp_path / "weld.mcap") as recorder:
        recorder.log("/events", kind=7, detail="living")
        with pytest.raises(UsageError, match="is being recorded"):
            recover(tmp_path / "weld.mcap.part", tmp_path / "z.mcap")
    assert not (tmp_path / "z.mcap").exists()


def test_programs_read_the_losses(live: Path, capsys: pytest.CaptureFixture[str]) -> None:
    entry = entries(live)[2]
    data = bytearray(live.read_bytes())
    data[entry.offset : entry.offset + entry.length] = bytes(entry.length)
    live.write_bytes(data)
    assert run(["recover", str(live), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "seamlog.recover"
    rows = {row["topic"]: row for row in document["channels"]}
    assert rows["/table/encoder"] == {
        "topic": "/table/encoder",
        "kept": 15,
        "from_rings": 0,
        "unproved": 0,
        "lost": 3,
    }
    assert run(["recover", str(live)]) == 2
    assert run(["recover", str(live), "--force"]) == 1
    assert "Some of it is lost" in capsys.readouterr().out


def test_messages_of_a_channel_whose_record_is_gone_are_kept_under_its_number(
    tmp_path: Path,
) -> None:
    """Of three channels in a chunk one has its record left and its index, which spans the chunk."""
    path = tmp_path / "x.mcap"
    write_foreign(path, {}, 200)
    whole, first, entry = path.read_bytes(), entries(path)[0], entries(path)[2]
    texts = (struct.pack("<I", len(text)) + text for text in (b"/table/encoder", b"cdr", b""))
    channel = struct.pack("<HH", 1, 0) + b"".join(texts)
    left = [whole[: first.offset], struct.pack("<BQ", records.CHANNEL, len(channel)), channel]
    index = entry.index_offsets[1]
    size = 9 + int.from_bytes(whole[index + 1 : index + 9], "little")
    left += [whole[entry.offset :][: entry.length], whole[index:][:size]]
    path.write_bytes(b"".join(left))
    found = recover(path)
    named = {"/table/encoder", "/recovered/channel_2", "/recovered/channel_3"}
    assert {row.topic for row in found.channels} == named
    with open_session(found.output) as session:
        counts = {topic: row.count for topic, row in session.info.channels.items()}
    assert counts == {row.topic: row.kept for row in found.channels}
    assert min(counts.values()) > 2
