"""Serial encoders on pty pairs: text and binary frames, damage, device time, a line that breaks."""

import os
import struct
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seamlog import open_session
from seamlog.cli import run
from seamlog.recorder.sources.device_clock import DeviceClock
from seamlog.recorder.sources.frames import AsciiFrame, BinaryFrame, crc16_ccitt, crc16_modbus
from tests.recorder.sources.recording import recording, until_logged

ASCII = """
[source]
port = "{port}"
[source.frame]
kind = "ascii"
pattern = 'X(?P<x>[-+]?\\d+);V(?P<v>[-+]?[\\d.]+)'
[source.values]
position_m = {{ name = "x", scale = 1e-6, offset = 0.5 }}
velocity_m_s = {{ name = "v", scale = 1e-3 }}
"""
BINARY = """
[source]
port = "{port}"
topic = "/table/encoder"
[source.frame]
kind = "binary"
sync = "aa55"
layout = "<Hi"
names = ["ticks", "position"]
checksum = "crc16-modbus"
[source.values]
position_m = {{ name = "position", scale = 1e-6 }}
[source.time]
name = "ticks"
tick_s = 1e-3
wraps = 65536
"""


@contextmanager
def line() -> Iterator[tuple[int, str]]:
    """A pty pair: the descriptor of the device's end and the name of the computer's."""
    device, computer = os.openpty()
    tty.setraw(device)
    name = os.ttyname(computer)
    os.close(computer)
    try:
        yield device, name
    finally:
        with suppress(OSError):
            os.close(device)


@contextmanager
def sending(device: int, frame: Callable[[int], bytes], period_s: float = 0.004) -> Iterator[None]:
    """A device that sends frame after frame, as long as somebody listens or not."""
    stop = threading.Event()

    def send() -> None:
        number = 0
        while not stop.wait(period_s):
            with suppress(OSError):
                os.write(device, frame(number))
            number += 1

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def text_frame(number: int) -> bytes:
    return b"#noise\n" if number % 50 == 30 else b"X%d;V%.1f\r\n" % (number, number / 10)


def binary_frame(number: int) -> bytes:
    body = struct.pack("<Hi", (65_500 + number * 4) % 65_536, -number)
    damaged = number % 40 == 20
    return b"\xaa\x55" + body + (b"??" if damaged else crc16_modbus(body))


def test_lines_of_text(tmp_path: Path) -> None:
    with line() as (device, port), sending(device, text_frame):
        (tmp_path / "c.toml").write_text(ASCII.format(port=port))
        session = tmp_path / "weld.mcap"
        options = ("--source", "serial", "--config", str(tmp_path / "c.toml"))
        with recording(session, *options) as running:
            running.wait_until(until_logged(session, "/table/encoder", 100))
            ended = running.interrupt()
    assert ended.code == 0, ended.errors
    assert ended.document["ended"] == "interrupted"
    with open_session(session) as opened:
        columns = opened.columns("/table/encoder")
        numbers = np.round((columns["position_m"] - 0.5) * 1e6).astype(int)
        steps = np.diff(numbers)
        assert set(steps.tolist()) <= {1, 2}
        assert (steps == 2).any()
        np.testing.assert_allclose(columns["velocity_m_s"], numbers / 10 * 1e-3, atol=1e-9)
        assert (np.abs(columns["log_time_ns"] - columns["stamp_ns"]) < 1e9).all()
        source = opened.metadata["seamlog.source"]
        assert int(source["damaged_frames"]) >= 1
        assert "noise" in source["first"]


def test_binary_frames_with_checksum_and_device_time(tmp_path: Path) -> None:
    with line() as (device, port), sending(device, binary_frame):
        (tmp_path / "c.toml").write_text(BINARY.format(port=port))
        session = tmp_path / "weld.mcap"
        options = ("--source", "serial", "--config", str(tmp_path / "c.toml"))
        with recording(session, *options) as running:
            running.wait_until(until_logged(session, "/table/encoder", 100))
            ended = running.interrupt()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        columns = opened.columns("/table/encoder")
        metadata = opened.channel_metadata("/table/encoder")
        damaged = int(opened.metadata["seamlog.source"]["damaged_frames"])
    numbers = np.round(-columns["position_m"] * 1e6).astype(int)
    assert damaged >= 1
    assert not (numbers % 40 == 20).any()
    assert np.isnan(columns["velocity_m_s"]).all()
    assert metadata["absent"] == "velocity_m_s"
    # 4 ms of device time from one frame to the next, whatever the machine did meanwhile.
    apart = np.diff(columns["stamp_ns"]) / np.diff(numbers)
    assert np.median(apart) == pytest.approx(4e6, rel=1e-3)


def test_a_line_that_breaks_is_opened_again(tmp_path: Path) -> None:
    link = tmp_path / "encoder"
    session = tmp_path / "weld.mcap"
    with line() as (device, port), sending(device, text_frame):
        link.symlink_to(port)
        (tmp_path / "c.toml").write_text(ASCII.format(port=link))
        options = ("--source", "serial", "--config", str(tmp_path / "c.toml"))
        with recording(session, *options) as running:
            running.wait_until(until_logged(session, "/table/encoder", 30))
            with line() as (other, again), sending(other, text_frame):
                link.unlink()
                os.close(device)
                time.sleep(0.3)
                link.symlink_to(again)
                running.wait_until(until_logged(session, "/events", 2))
                running.wait_until(until_logged(session, "/table/encoder", 60))
                ended = running.interrupt()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        details = opened.columns("/events")["detail"].tolist()
    assert "is lost and is opened again" in details[0]
    assert "is back" in details[1]


def test_a_port_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "c.toml").write_text(ASCII.format(port=tmp_path / "none"))
    session = tmp_path / "weld.mcap"
    options = ["--source", "serial", "--config", str(tmp_path / "c.toml")]
    assert run(["record", "-o", str(session), *options]) == 4
    assert "serial ports here" in capsys.readouterr().err
    assert list(tmp_path.glob("*.mcap*")) == []


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("position_m =", "place_m =", "no field place_m"),
        ('name = "x"', 'name = "y"', "holds no y"),
        ("(?P<x>", "(", "holds no x"),
        ("[source.frame]", '[source.frame]\nsync = "aa"', "no such key"),
        ('port = "p"', 'port = "p"\ntopic = "/camera/image"', "not a topic of numbers"),
    ],
)
def test_faults_of_the_configuration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, hint: str
) -> None:
    text = ASCII.format(port="p")
    assert old in text
    (tmp_path / "c.toml").write_text(text.replace(old, new, 1))
    options = ["--source", "serial", "--config", str(tmp_path / "c.toml")]
    assert run(["record", "-o", str(tmp_path / "weld.mcap"), *options]) == 2
    assert hint in capsys.readouterr().err


FRAME = BinaryFrame(sync="aa55", layout=">hB", names=("a", "b"), checksum="crc16-ccitt")


def packed(a: int, b: int) -> bytes:
    body = struct.pack(">hB", a, b)
    return b"\xaa\x55" + body + crc16_ccitt(body)


@given(
    st.lists(st.tuples(st.integers(-32768, 32767), st.integers(0, 255)), max_size=20),
    st.binary(max_size=12),
    st.integers(1, 40),
)
def test_frames_come_out_however_they_are_cut(
    rows: list[tuple[int, int]], noise: bytes, size: int
) -> None:
    data = noise.replace(b"\xaa", b"") + b"".join(packed(*row) for row in rows)
    reader, found = FRAME.reader(), []
    for at in range(0, len(data), size):
        found += [frame for frame, _ in reader.feed(data[at : at + size])]
    assert [(frame["a"], frame["b"]) for frame in found] == rows


@given(st.binary(max_size=300), st.integers(1, 50))
def test_noise_is_bounded_and_never_raises(data: bytes, size: int) -> None:
    readers = (FRAME.reader(), AsciiFrame(pattern="(?P<x>.*)").reader())
    for at in range(0, len(data), size):
        for reader in readers:
            list(reader.feed(data[at : at + size]))


def test_checksums_are_the_published_ones() -> None:
    assert crc16_modbus(b"123456789") == (0x4B37).to_bytes(2, "little")
    assert crc16_ccitt(b"123456789") == (0x29B1).to_bytes(2, "big")


def test_device_time_follows_the_fastest_messages() -> None:
    clock, dice = DeviceClock(1000.0, 65_536), np.random.default_rng(1)
    true = np.arange(5000) * 1_000_000
    late = dice.exponential(2e5, 5000).astype(int)
    stamps = [
        clock.stamp_ns(int(t // 1000 % 65_536), int(10**18 + t + d))
        for t, d in zip(true, late, strict=True)
    ]
    error = np.array(stamps)[500:] - 10**18 - true[500:]
    assert np.abs(error).max() < 20_000
