"""Cut, flipped and hostile files: what is read is right, what is missing is said."""

import logging
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard

import seamlog
from seamlog.errors import FrameMissing, LimitExceeded, SessionError
from seamlog.limits import Limits
from seamlog.mcap import records
from tests.core.scenarios import START_NS, Expected, assert_same, picture, write_foreign, write_live

Rows = set[tuple[object, ...]]


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    logging.getLogger("seamlog").setLevel(logging.CRITICAL)
    yield
    logging.getLogger("seamlog").setLevel(logging.NOTSET)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, Expected]:
    path = tmp_path_factory.mktemp("whole") / "x.mcap"
    expected = write_live(path, chunks=2)
    return path.read_bytes(), expected


def rows_of(columns: Mapping[str, Any], names: tuple[str, ...]) -> Rows:
    def plain(value: object) -> object:
        return value.tobytes() if isinstance(value, np.ndarray) else value

    return {
        tuple(plain(value) for value in row)
        for row in zip(*(list(columns[name]) for name in names), strict=True)
    }


NAMES = {
    "/table/encoder": ("log_time_ns", "stamp_ns", "position_m", "velocity_m_s"),
    "/camera/image": ("log_time_ns", "stamp_ns", "format", "data"),
}


def read_all(path: Path, expected: Expected) -> tuple[int, list[str]]:
    """Check that nothing read is wrong; the number of rows and the problems."""
    count = 0
    with seamlog.open_session(path) as session:
        _ = session.info
        for topic in session.info.channels:
            found = rows_of(session.columns(topic), NAMES[topic])
            assert found <= rows_of(expected[topic], NAMES[topic])
            count += len(found)
        if "/camera/image" in session.info.channels:
            read_frames(session)
        if "photo/a.jpg" in session.attachments:
            try:
                assert session.attachments["photo/a.jpg"].data == picture(3)
            except SessionError:
                count -= 1
                session.files[0].note("attachment")
        return count, session.problems


def read_frames(session: seamlog.Session) -> None:
    frames = session.frames()
    for place in range(len(frames)):
        try:
            frame = frames[place]
        except FrameMissing:
            continue
        assert frame.data == picture((frame.stamp_ns + 5 - START_NS) // 40_000_000)


TOTAL = 8


def test_a_file_cut_anywhere_is_read_as_far_as_it_goes(
    whole: tuple[bytes, Expected], tmp_path: Path
) -> None:
    data, expected = whole
    path = tmp_path / "cut.mcap"
    most = 0
    for size in range(len(data)):
        path.write_bytes(data[:size])
        try:
            count, problems = read_all(path, expected)
        except SessionError as error:
            assert str(path) in str(error)
            assert most == 0
            continue
        assert problems
        assert count >= most
        most = count
    assert most == TOTAL


def flips(data: bytes) -> Iterator[tuple[int, bytes]]:
    for place in range(0, len(data), 2):
        flipped = bytearray(data)
        flipped[place] ^= 1 << (place // 2 % 8)
        yield place, bytes(flipped)


def test_a_flipped_bit_never_gives_a_wrong_value(
    whole: tuple[bytes, Expected], tmp_path: Path
) -> None:
    data, expected = whole
    path = tmp_path / "flip.mcap"
    complete = 0
    for place, flipped in flips(data):
        path.write_bytes(flipped)
        try:
            count, problems = read_all(path, expected)
        except SessionError as error:
            assert str(path) in str(error), place
            continue
        assert count == TOTAL or problems, place
        complete += count == TOTAL
    assert complete > len(data) // 6


@pytest.mark.parametrize("kind", ["empty", "foreign", "short"])
def test_what_is_no_session_is_refused(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes({"empty": b"", "foreign": b"PK\x03\x04" * 9, "short": records.MAGIC}[kind])
    with pytest.raises(SessionError, match=r"x\.mcap.*;"):
        seamlog.open_session(path)


def test_a_missing_file_is_the_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        seamlog.open_session(tmp_path / "none.mcap")


def chunk_file(body: bytes, declared: int, compression: str) -> bytes:
    head = records.chunk_head(0, 1, declared, 0, compression, len(body))
    return records.MAGIC + records.header("ros2", "x") + head + body


def test_a_bomb_is_refused_before_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "bomb.mcap"
    body = zstandard.ZstdCompressor(level=3).compress(bytes(64 << 20))
    path.write_bytes(chunk_file(body, 64 << 20, "zstd"))
    with pytest.raises(LimitExceeded, match="chunk_bytes"):
        seamlog.open_session(path, Limits(chunk_bytes=1 << 20))


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_lies_about_its_size_is_left_out(tmp_path: Path, compression: str) -> None:
    import lz4.frame

    path = tmp_path / "lie.mcap"
    content = bytes(32 << 20)
    body = (
        zstandard.ZstdCompressor().compress(content)
        if compression == "zstd"
        else lz4.frame.compress(content)
    )
    path.write_bytes(chunk_file(body, 1000, compression))
    with seamlog.open_session(path) as session:
        assert any("more bytes than the 1000" in text for text in session.problems)
        assert session.info.message_count == 0


def test_overlapping_chunks_are_not_read_twice(
    whole: tuple[bytes, Expected], tmp_path: Path
) -> None:
    data, expected = whole
    end = len(data) - records.END_BYTES
    start = struct.unpack_from("<Q", data, end + 9)[0]
    offset = data.index(b"\x08", start)
    summary = bytearray(data[start:])
    entry = data[offset : offset + records.RECORD_HEAD.unpack_from(data, offset)[1] + 9]
    summary = bytearray(entry) + summary
    crc = zlib.crc32(summary[: -len(records.MAGIC) - 4])
    struct.pack_into("<I", summary, len(summary) - len(records.MAGIC) - 4, crc)
    path = tmp_path / "overlap.mcap"
    path.write_bytes(data[:start] + summary)
    count, problems = read_all(path, expected)
    assert count == TOTAL
    assert problems


def test_damage_met_while_reading_is_said(whole: tuple[bytes, Expected], tmp_path: Path) -> None:
    data, _ = whole
    place = data.index(picture(1)) + 20
    path = tmp_path / "x.mcap"
    path.write_bytes(data[:place] + b"?" + data[place + 1 :])
    with seamlog.open_session(path) as session:
        assert session.problems == []
        frames = session.frames()
        assert len(frames) == 2
        with pytest.raises(FrameMissing, match="CRC"):
            _ = frames[1]
        assert len(session.columns("/camera/image")["stamp_ns"]) == 1
        assert any("CRC" in text for text in session.info.problems)


@pytest.mark.parametrize("place", [3, 14, 15, 22, 23, 24, 16 * 900 + 20])
def test_a_wrong_message_index_changes_nothing(tmp_path: Path, place: int) -> None:
    expected = write_foreign(tmp_path / "x.mcap", {"chunk_size": 600_000}, 3000)
    with seamlog.open_session(tmp_path / "x.mcap") as session:
        entry = session.files[0].index.chunks[0]
    data = bytearray((tmp_path / "x.mcap").read_bytes())
    data[entry.index_offsets[1] + place] ^= 0x15
    (tmp_path / "x.mcap").write_bytes(data)
    with seamlog.open_session(tmp_path / "x.mcap") as session:
        for topic, columns in expected.items():
            assert_same(session.columns(topic), columns)


def test_a_file_that_shrinks_to_nothing_is_not_left_open(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(b"no session at all")
    before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
    for _ in range(5):
        with pytest.raises(SessionError):
            seamlog.open_session(path)
    assert len(os.listdir("/proc/self/fd")) == before  # noqa: PTH208
