"""The live view: what a viewer sees, and that no viewer can hold a recording up."""

import base64
import json
import os
import socket
import struct
import time
from pathlib import Path

import pytest
from websockets.sync.client import ClientConnection, connect

from seamlog import open_session
from seamlog.cli import run
from seamlog.recorder import Recorder
from seamlog.recorder.live_tail import LiveTail
from seamlog.recorder.storage import Storage
from tests.recorder.sources.recording import Recording, recording

PROTOCOL = "foxglove.sdk.v1"


def free_port() -> int:
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


def connected(running: Recording, port: int) -> ClientConnection:
    found: list[ClientConnection] = []

    def try_it() -> bool:
        try:
            found.append(
                connect(f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL], max_size=None)  # type: ignore[list-item]
            )
        except OSError:
            return False
        return True

    running.wait_until(try_it)
    return found[0]


def advertised(viewer: ClientConnection, topic: str) -> dict[str, object]:
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        text = viewer.recv(timeout=30)
        if isinstance(text, str):
            for channel in json.loads(text).get("channels", []):
                if channel["topic"] == topic:
                    return dict(channel)
    raise AssertionError(f"{topic} was not advertised")


def subscribe(viewer: ClientConnection, channel: dict[str, object]) -> None:
    subscription = {"id": 1, "channelId": channel["id"]}
    viewer.send(json.dumps({"op": "subscribe", "subscriptions": [subscription]}))


def options(port: int, seconds: int = 4) -> tuple[str, ...]:
    cell = ("--source", "virtual-cell", "--pace", "realtime", "--duration", str(seconds))
    return (*cell, "--live", str(port))


def test_a_viewer_sees_what_is_recorded(tmp_path: Path) -> None:
    port, session = free_port(), tmp_path / "weld.mcap"
    with recording(session, *options(port, 600)) as running:
        with connected(running, port) as viewer:
            channel = advertised(viewer, "/table/encoder")
            assert channel["encoding"] == "cdr"
            assert channel["schemaName"] == "seamlog_msgs/msg/Encoder"
            assert "float64 position_m" in str(channel["schema"])
            subscribe(viewer, channel)
            seen: list[int] = []
            while len(seen) < 10:
                data = viewer.recv(timeout=30)
                if isinstance(data, bytes) and data[0] == 1:
                    seen.append(struct.unpack_from("<q", data, 13 + 4)[0])
        ended = running.interrupt()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        stamps = opened.columns("/table/encoder")["stamp_ns"].tolist()
    assert set(seen) <= set(stamps)


def test_a_viewer_that_stalls_holds_nothing_up(tmp_path: Path) -> None:
    port, session = free_port(), tmp_path / "weld.mcap"
    with recording(session, *options(port)) as running:
        with connected(running, port) as viewer:
            ids = [advertised(viewer, "/camera/image")["id"]]
        with socket.create_connection(("127.0.0.1", port)) as stalled:
            stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            key = base64.b64encode(os.urandom(16)).decode()
            stalled.sendall(
                f"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
                f"Sec-WebSocket-Protocol: {PROTOCOL}\r\n\r\n".encode()
            )
            text = json.dumps(
                {"op": "subscribe", "subscriptions": [{"id": 1, "channelId": i} for i in ids]}
            ).encode()
            stalled.sendall(bytes([0x81, 0x80 | len(text), 0, 0, 0, 0]) + text)
            ended = running.end()
    assert ended.code == 0, ended.errors
    assert ended.document["complete"]
    assert all(row["dropped"] == 0 for row in ended.document["channels"])


def test_a_port_in_use_is_said_before_anything_is_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert run(["record", "-o", str(tmp_path / "weld.mcap"), *options(port)]) == 4
    assert "cannot be used" in capsys.readouterr().err
    assert run(["record", "-o", str(tmp_path / "weld.mcap"), *options(0)]) == 2
    assert list(tmp_path.iterdir()) == []


def test_the_tail_goes_on_from_file_to_file(tmp_path: Path) -> None:
    session = tmp_path / "weld.mcap"
    tail, seen = LiveTail(session), list[int]()
    assert list(tail.messages()) == []
    storage = Storage(segment_bytes=1 << 20)
    with Recorder(session, pace="simulated", storage=storage) as recorder:
        points = recorder.channel("/seam/points")
        for stamp in range(120):
            values = struct.unpack("<4000q", os.urandom(8 * 4000))
            assert points.put(stamp, [float(value) for value in values], [1.0])
            seen += [m.log_time_ns for m in tail.messages() if m.channel.topic == "/seam/points"]
    seen += [m.log_time_ns for m in tail.messages() if m.channel.topic == "/seam/points"]
    tail.close()
    assert len(list(tmp_path.glob("weld*.mcap"))) > 2
    assert len(seen) == 120
