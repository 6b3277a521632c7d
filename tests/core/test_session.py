"""Sessions: windows, welds, frames, segments, tables, and what is not there."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import seamlog
from seamlog import messages
from seamlog.channels import ARC_OFF, ARC_ON, CHANNELS
from seamlog.errors import (
    ChannelMissing,
    FrameMissing,
    ImageError,
    LimitExceeded,
    SessionError,
    UnknownName,
)
from seamlog.limits import Limits
from seamlog.mcap.batch import BatchWriter
from tests.core.scenarios import START_NS, encoder_columns, times, write_live, write_numeric


def jpeg(level: int, size: tuple[int, int] = (6, 8)) -> bytes:
    return bytes(cv2.imencode(".png", np.full((*size, 3), level, np.uint8))[1])


@pytest.fixture
def weld(tmp_path: Path) -> Path:
    """20 encoder samples and 5 frames; arc on from sample 5 to 12 and from 15 on."""
    path = tmp_path / "weld.mcap"
    events, camera = CHANNELS["/events"], CHANNELS["/camera/image"]
    rows = [(5, ARC_ON), (12, ARC_OFF), (15, ARC_ON)]
    stamps = times(20).tolist()
    with BatchWriter(path) as writer:
        writer.write("/table/encoder", encoder_columns(20), metadata={"unit": "m"})
        payloads = [messages.encode(events, (stamps[at], kind, "")) for at, kind in rows]
        writer.write_payloads("/events", events, payloads, [stamps[at] for at, _ in rows])
        frames = [
            messages.encode_image(stamps[at] - 1000, "camera", "png", jpeg(at))
            for at in range(0, 20, 4)
        ]
        writer.write_payloads("/camera/image", camera, frames, times(20)[::4])
        writer.attach("photo/bead.png", jpeg(3), "image/png", START_NS)
        writer.add_metadata("seamlog.truth", {"json": "{}"})
    return path


def test_info_counts_and_names(weld: Path) -> None:
    with seamlog.open_session(weld) as session:
        info = session.info
    assert info.message_count == 28
    assert info.start_ns == START_NS
    assert info.duration_s == pytest.approx(0.76)
    assert info.channels["/table/encoder"].rate_hz == pytest.approx(25.0)
    assert info.channels["/table/encoder"].metadata == {"unit": "m"}
    assert info.attachments == ["photo/bead.png"]
    assert set(info.metadata) == {"seamlog.truth", "seamlog.recording"}
    assert info.recording_id and info.size_bytes == weld.stat().st_size


def test_welds_are_arc_on_to_arc_off(weld: Path) -> None:
    with seamlog.open_session(weld) as session:
        first, second = session.welds
        assert (first.start_ns, first.end_ns) == (times(20)[5], times(20)[12])
        assert second.end_ns == times(20)[19] + 1
        assert any("no ARC_OFF" in text for text in session.problems)
        assert len(session.weld(1).columns("/table/encoder")["stamp_ns"]) == 7
        assert session.weld(1).info.welds == [first]
        assert session.weld(2).info.channels["/table/encoder"].count == 5
        with pytest.raises(UnknownName, match="no weld 3; it has 2"):
            session.weld(3)


def test_a_closed_session_says_so(weld: Path) -> None:
    with seamlog.open_session(weld) as session:
        kept = session.columns("/table/encoder")
        frames = session.frames()
    assert kept["stamp_ns"].tolist() == times(20).tolist()
    assert session.problems == []
    for read in (lambda: session.columns("/table/encoder"), lambda: frames[0]):
        with pytest.raises(SessionError, match="closed"):
            read()
    session.close()


def test_windows_are_half_open_and_nest(weld: Path) -> None:
    t = times(20).tolist()
    with seamlog.open_session(weld) as session:
        window = session.window(t[3], t[10])
        assert window.columns("/table/encoder")["stamp_ns"].tolist() == t[3:10]
        assert window.window(0, t[5]).columns("/table/encoder")["stamp_ns"].tolist() == t[3:5]
        assert len(window.window(t[12], t[19]).columns("/table/encoder")["stamp_ns"]) == 0
        assert window.info.message_count == 7 + 1 + 2
        assert window.frames().log_times_ns.tolist() == [t[4], t[8]]


def test_frames_are_found_by_time(weld: Path) -> None:
    t = times(20).tolist()
    with seamlog.open_session(weld) as session:
        frames = session.frames()
        assert len(frames) == 5
        assert frames.stamps_ns.tolist() == [stamp - 1000 for stamp in t[::4]]
        assert frames.at(t[4] + 5).stamp_ns == t[4] - 1000
        assert frames.at(0).log_time_ns == t[0]
        assert frames.at(2**62).log_time_ns == t[16]
        assert [frame.log_time_ns for frame in frames[1:3]] == [t[4], t[8]]
        frame = frames[-1]
        assert (frame.format, frame.data) == ("png", jpeg(16))
        np.testing.assert_array_equal(frame.image(), np.full((6, 8, 3), 16, np.uint8))
        with pytest.raises(FrameMissing, match="empty"):
            session.window(0, 5).frames().at(3)


def test_pictures_are_checked_before_they_are_decoded(tmp_path: Path) -> None:
    camera = CHANNELS["/camera/image"]
    pictures = [jpeg(1), b"\xff\xd8\xff\xe0", b"GIF89a", jpeg(1)[:40], jpeg(1, (300, 300))]
    payloads = [messages.encode_image(START_NS, "", "x", data) for data in pictures]
    with BatchWriter(tmp_path / "x.mcap") as writer:
        writer.write_payloads("/camera/image", camera, payloads, times(5))
    limits = Limits(image_pixels=50_000)
    with seamlog.open_session(tmp_path / "x.mcap", limits) as session:
        frames = session.frames()
        assert frames[0].image().shape == (6, 8, 3)
        for place in (1, 2, 3):
            with pytest.raises(ImageError, match="/camera/image"):
                frames[place].image()
        with pytest.raises(LimitExceeded, match="image_pixels"):
            frames[4].image()


def test_unknown_topics_fields_and_attachments_name_the_known(weld: Path) -> None:
    with seamlog.open_session(weld) as session:
        with pytest.raises(ChannelMissing, match=r"no channel /nope; there are: .*/events"):
            session.columns("/nope")
        with pytest.raises(UnknownName, match="position_m"):
            session.columns("/table/encoder", ["position"])
        with pytest.raises(KeyError, match=r"photo/bead\.png"):
            _ = session.attachments["photo/other.png"]
        with pytest.raises(SessionError, match="not sensor_msgs"):
            session.frames("/table/encoder")
        assert session.channel_metadata("/table/encoder") == {"unit": "m"}
        assert session.attachments["photo/bead.png"].data == jpeg(3)
        assert session.metadata["seamlog.truth"] == {"json": "{}"}


def test_a_table_spreads_arrays(tmp_path: Path) -> None:
    expected = write_numeric(tmp_path / "x.mcap", "zstd", 10)
    with seamlog.open_session(tmp_path / "x.mcap") as session:
        table = session.table("/replay/pd/state")
        assert len(session.table("/table/encoder")) == 10
    assert list(table) == ["log_time_ns", "stamp_ns", *(f"values[{n}]" for n in range(8))]
    np.testing.assert_array_equal(table["values[3]"], expected["/replay/pd/state"]["values"][:, 3])


def write_segment(path: Path, recording: str, index: int, part: slice) -> None:
    with BatchWriter(path) as writer:
        writer.add_metadata("seamlog.recording", {"id": recording, "index": str(index)})
        writer.write("/table/encoder", {k: v[part] for k, v in encoder_columns(30).items()})


def test_any_file_of_a_recording_opens_all_of_it(tmp_path: Path) -> None:
    for index, name in enumerate(("weld.mcap", "weld.0002.mcap", "weld.0003.mcap")):
        write_segment(tmp_path / name, "a", index + 1, slice(10 * index, 10 * index + 10))
    write_segment(tmp_path / "weld.0004.mcap", "another", 4, slice(0, 3))
    for path in (tmp_path / "weld.mcap", tmp_path / "weld.0003.mcap"):
        with seamlog.open_session(path) as session:
            assert [item.name for item in session.paths][1:] == ["weld.0002.mcap", "weld.0003.mcap"]
            assert session.columns("/table/encoder")["stamp_ns"].tolist() == times(30).tolist()
            assert session.info.channels["/table/encoder"].count == 30
            assert session.info.problems == []
    with pytest.raises(SessionError, match="different recordings"):
        seamlog.open_session(tmp_path)
    (tmp_path / "weld.0004.mcap").unlink()
    (tmp_path / "weld.0002.mcap").unlink()
    with seamlog.open_session(tmp_path) as session:
        assert len(session.columns("/table/encoder")["stamp_ns"]) == 20
        assert any("file 2 of the recording" in text for text in session.info.problems)


def test_copies_of_one_recording_in_a_folder_are_not_mixed(tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        write_segment(tmp_path / name, "same", 1, slice(0, 5))
    with pytest.raises(SessionError, match="more than once"):
        seamlog.open_session(tmp_path)
    with pytest.raises(SessionError, match=r"without an \.mcap file"):
        seamlog.open_session(_made(tmp_path / "empty"))


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def test_opening_and_info_load_no_heavy_library(tmp_path: Path) -> None:
    write_live(tmp_path / "x.mcap")
    code = (
        "import sys, json\n"
        "from seamlog.cli import run\n"
        f"run(['info', {str(tmp_path / 'x.mcap')!r}])\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout
    loaded = set(json.loads(out.decode().splitlines()[-1]))
    assert not loaded & {"cv2", "pandas", "scipy", "pyarrow"}
    code = "import sys, seamlog; sys.exit('numpy' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
