"""Modbus RTU: a pymodbus server behind a pair of lines that socat made."""

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from seamlog import open_session
from seamlog.cli import run
from tests.conftest import missing
from tests.recorder.sources.recording import recording, until_logged

SERVER = Path(__file__).with_name("modbus_server.py")
CONFIG = """
[source]
port = "{port}"
baud = 115200
device_id = 7
period_s = 0.01
address = 100
layout = "ih"
names = ["position", "speed"]
[source.values]
position_m = {{ name = "position", scale = 1e-6 }}
velocity_m_s = {{ name = "speed", scale = 1e-3 }}
"""


@pytest.fixture
def line(tmp_path: Path) -> Iterator[tuple[str, str]]:
    if not shutil.which("socat"):
        missing("socat", "no socat; install Debian's package socat")
    ends = tmp_path / "device", tmp_path / "computer"
    command = ["socat", *(f"pty,raw,echo=0,link={end}" for end in ends)]
    with subprocess.Popen(command) as socat:
        while not all(end.exists() for end in ends):
            assert socat.poll() is None
            time.sleep(0.01)
        yield str(ends[0]), str(ends[1])
        socat.terminate()


@contextmanager
def server(port: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, str(SERVER), port]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        assert running.stdout.readline() == "ready\n"
        try:
            yield running
        finally:
            running.kill()


def test_registers_become_messages_and_silence_an_event(
    tmp_path: Path, line: tuple[str, str]
) -> None:
    (tmp_path / "c.toml").write_text(CONFIG.format(port=line[1]))
    session = tmp_path / "weld.mcap"
    options = ("--source", "modbus", "--config", str(tmp_path / "c.toml"))
    with server(line[0]) as first, recording(session, *options) as running:
        running.wait_until(until_logged(session, "/table/encoder", 20))
        first.kill()
        running.wait_until(until_logged(session, "/events", 1))
        with server(line[0]):
            running.wait_until(until_logged(session, "/events", 2))
            ended = running.interrupt()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        columns = opened.columns("/table/encoder")
        details = opened.columns("/events")["detail"].tolist()
    np.testing.assert_allclose(columns["position_m"], -0.123456)
    np.testing.assert_allclose(columns["velocity_m_s"], 1.5)
    assert (np.diff(columns["stamp_ns"]) > 0).all()
    assert "no answer" in details[0]
    assert "answers again" in details[1]


def test_a_device_that_never_answers(
    tmp_path: Path, line: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "c.toml").write_text(CONFIG.format(port=line[1]) + "[source.nothing]\n")
    options = ["--source", "modbus", "--config", str(tmp_path / "c.toml")]
    output = ["record", "-o", str(tmp_path / "weld.mcap")]
    assert run([*output, *options]) == 2
    (tmp_path / "c.toml").write_text(CONFIG.format(port=line[1]))
    assert run([*output, *options, "--set", "source.timeout_s=0.05"]) == 4
    assert "device 7 does not answer" in capsys.readouterr().err
