"""Cameras: GenICam's virtual producer, a network camera of our own, and those that are missing."""

import os
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest

from seamlog import open_session
from seamlog.cli import run
from tests.recorder.sources.recording import recording, until_logged

TOPIC = "/camera/image"


@pytest.fixture
def producer() -> Path:
    genicam = pytest.importorskip("genicam")
    path = Path(genicam.__file__).with_name("viky.cti")
    if not path.exists():
        pytest.skip("this wheel of genicam brings no virtual producer")
    return path


def test_a_camera_without_time_stamps(tmp_path: Path, producer: Path) -> None:
    session = tmp_path / "weld.mcap"
    options = ["--source", "genicam", "--set", f"source.producer={producer}"]
    with recording(session, *options) as running:
        running.wait_until(until_logged(session, TOPIC, 5))
        ended = running.interrupt()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        assert opened.channel_metadata(TOPIC)["stamp"] == "arrival"
        frames = opened.frames()
        assert frames[0].image().shape == (400, 400, 3)
        columns = opened.columns(TOPIC, ["stamp_ns"])
    assert (np.abs(columns["log_time_ns"] - columns["stamp_ns"]) < 10**9).all()


@pytest.mark.parametrize("flags", [("-DTICKS_HZ=125000000",), ("-DTICKS_HZ=1000", "-DWITH_NS")])
def test_a_camera_with_time_stamps(tmp_path: Path, producer: Path, flags: tuple[str, ...]) -> None:
    stamped, session = tmp_path / "stamped.cti", tmp_path / "weld.mcap"
    source = Path(__file__).with_name("stamped.c")
    compiler = shutil.which("gcc") or pytest.skip("no gcc to build a GenTL producer with")
    folder = producer.parent
    linked = ["-L", str(folder), f"-l:{producer.name}", f"-Wl,-rpath,{folder}", "-ldl"]
    command = [compiler, "-shared", "-fPIC", "-D_GNU_SOURCE", *flags, str(source), "-o"]
    subprocess.run([*command, str(stamped), "-Wl,--no-as-needed", *linked], check=True)
    options = ["--source", "genicam", "--set", f"source.producer={stamped}"]
    with recording(session, *options) as running:
        running.wait_until(until_logged(session, TOPIC, 20))
        ended = running.interrupt()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        assert opened.channel_metadata(TOPIC)["stamp"] == "camera"
        columns = opened.columns(TOPIC, ["stamp_ns"])
    assert (columns["stamp_ns"] <= columns["log_time_ns"]).all()
    assert (columns["log_time_ns"] - columns["stamp_ns"] < 10**9).all()
    # Whole milliseconds apart, but for what the clocks may drift.
    steps = np.diff(columns["stamp_ns"][2:])
    assert (np.abs(steps - np.round(steps, -6)) < 50_000).mean() > 0.8


@pytest.mark.parametrize(
    ("setting", "hint"),
    [
        ("source.device=none", "the producer sees: VikyTL_DEV_red"),
        ("source.features.NoFeature=1", "does not take NoFeature"),
    ],
)
def test_a_camera_that_is_not_what_was_asked_for(
    tmp_path: Path, producer: Path, capsys: pytest.CaptureFixture[str], setting: str, hint: str
) -> None:
    settings = ["--set", f"source.producer={producer}", "--set", setting]
    options = ["record", "--source", "genicam", "-o", str(tmp_path / "weld.mcap"), *settings]
    assert run(options) == 4
    assert hint in capsys.readouterr().err


def test_probing_lists_cameras(
    producer: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("GENICAM_GENTL64_PATH", str(producer.parent))
    assert run(["sources", "probe", "genicam"]) == 0
    assert "VikyTL_DEV_green" in capsys.readouterr().out
    monkeypatch.setenv("GENICAM_GENTL64_PATH", "")
    assert run(["sources", "probe", "genicam"]) == 4
    assert "no GenTL producer" in capsys.readouterr().err


class _Stream(BaseHTTPRequestHandler):
    """An MJPEG stream, as network cameras send it."""

    pictures = 40

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=x")
        self.end_headers()
        for number in range(self.pictures):
            image = np.full((48, 64, 3), number * 5, np.uint8)
            data = cv2.imencode(".jpg", image)[1].tobytes()
            head = f"--x\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
            self.wfile.write(head.encode() + data + b"\r\n")
            time.sleep(0.02)

    def log_message(self, *_: object) -> None:
        return


@pytest.fixture
def stream() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), _Stream) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/mjpeg"
        server.shutdown()
        thread.join()


def test_a_network_camera_that_breaks_off_is_opened_again(tmp_path: Path, stream: str) -> None:
    session = tmp_path / "weld.mcap"
    options = ["--source", "camera", "--set", f'source.device="{stream}"']
    with recording(session, *options) as running:
        running.wait_until(until_logged(session, TOPIC, _Stream.pictures + 5))
        ended = running.interrupt()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        first = opened.frames()[2].image()
        details = opened.columns("/events")["detail"].tolist()
    assert first.shape[:2] == (48, 64)
    assert "is lost" in details[0]
    assert "is back" in details[1]


def test_no_camera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = ["--set", "source.device=77"]
    options = ["record", "--source", "camera", "-o", str(tmp_path / "weld.mcap"), *settings]
    assert run(options) == 4
    assert "V4L2 devices here" in capsys.readouterr().err
    assert os.listdir(tmp_path) == []  # noqa: PTH208
