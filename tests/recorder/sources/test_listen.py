"""Loops in other processes and languages, heard over ZeroMQ."""

import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zmq
from hypothesis import given
from hypothesis import strategies as st

from seamlog import open_session
from seamlog.channels import CHANNELS
from seamlog.cli import run
from seamlog.recorder.sources.wire import parse
from tests.conftest import missing
from tests.recorder.sources.recording import recording

CLIENT = Path(__file__).with_name("zmq_client.py")


def test_a_client_in_another_process(tmp_path: Path) -> None:
    address, session = f"ipc://{tmp_path}/loop", tmp_path / "weld.mcap"
    unit = 'source.metadata={"/table/command" = {unit = "N"}}'
    with recording(session, "--listen", address, "--set", unit) as running:
        subprocess.run([sys.executable, str(CLIENT), address], check=True, timeout=60)
        ended = running.end()
    assert ended.code == 0, ended.errors
    assert ended.document["ended"] == "the source ended"
    with open_session(session) as opened:
        encoder = opened.columns("/table/encoder")
        np.testing.assert_allclose(encoder["position_m"], np.arange(500) / 1000)
        assert encoder["stamp_ns"].tolist() == [1_000_000 * step for step in range(1, 501)]
        command = opened.columns("/table/command")
        assert (command["stamp_ns"][0], command["command"][0]) == (77, 3.0)
        assert command["saturated"][0]
        assert opened.channel_metadata("/table/command")["unit"] == "N"
        assert opened.columns("/seam/points")["x_px"][0].tolist() == [1.0, 2.0]
        events = opened.columns("/events")
        assert "Zündung" in events["detail"].tolist()
        assert sum("not logged" in text for text in events["detail"]) == 3
        assert bytes(opened.columns("/camera/image")["data"][0]) == b"\xff\xd8\xff\xe0jpeg"
        assert opened.metadata["seamlog.source"]["faults"] == "3"


def test_the_example_in_c(tmp_path: Path, project: Path) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        missing("cc", "no C compiler")
    client = tmp_path / "client"
    source = project / "examples" / "listen_client.c"
    command = [compiler, "-O2", "-Wall", "-Wextra", "-Werror", str(source)]
    built = subprocess.run(
        [*command, "-lzmq", "-lm", "-o", str(client)], capture_output=True, text=True, check=False
    )
    if "zmq.h" in built.stderr or "lzmq" in built.stderr:
        missing("libzmq", "no libzmq; install Debian's package libzmq3-dev")
    assert built.returncode == 0, built.stderr
    address, session = f"ipc://{tmp_path}/loop", tmp_path / "weld.mcap"
    with recording(session, "--listen", address) as running:
        subprocess.run([str(client), address], check=True, timeout=60)
        ended = running.end()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        encoder = opened.columns("/table/encoder")
        assert len(encoder["stamp_ns"]) == 1000
        np.testing.assert_allclose(encoder["position_m"], 0.1 * np.sin(np.arange(1000) / 1000))
        assert (np.abs(encoder["log_time_ns"] - encoder["stamp_ns"]) < 5e9).all()
        assert len(opened.columns("/table/command")["command"]) == 1000


def test_the_example_in_octave(tmp_path: Path, project: Path) -> None:
    octave = shutil.which("octave-cli")
    if octave is None:
        missing("octave", "no octave; install Debian's packages octave and octave-zeromq")
    address, session = f"ipc://{tmp_path}/loop", tmp_path / "weld.mcap"
    text = f"addpath('{project}/examples'); listen_client('{address}')"
    with recording(session, "--listen", address) as running:
        subprocess.run([octave, "--eval", text], check=True, timeout=90)
        ended = running.end()
    assert ended.code == 0, ended.errors
    with open_session(session) as opened:
        encoder = opened.columns("/table/encoder")
    np.testing.assert_allclose(encoder["position_m"], 0.1 * np.sin(np.arange(1000) / 1000))


def test_an_address_in_use(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with zmq.Context() as context, context.socket(zmq.PULL) as socket:
        port = socket.bind_to_random_port("tcp://127.0.0.1")
        address = f"tcp://127.0.0.1:{port}"
        assert run(["record", "--listen", address, "-o", str(tmp_path / "weld.mcap")]) == 4
    assert "cannot be listened to" in capsys.readouterr().err


def test_one_of_source_and_listen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = ["-o", str(tmp_path / "weld.mcap")]
    assert run(["record", *output]) == 2
    assert run(["record", *output, "--source", "serial", "--listen", "ipc:///x"]) == 2
    assert "either" in capsys.readouterr().err


@given(
    st.lists(
        st.binary(max_size=80)
        | st.sampled_from(
            [
                *(name.encode() for name in CHANNELS),
                *(b"json " + name.encode() for name in CHANNELS),
            ]
        ),
        max_size=4,
    )
)
def test_nonsense_is_a_value_error(parts: list[bytes]) -> None:
    try:
        topic, stamp_ns, values = parse(parts)
    except ValueError:
        return
    assert topic in CHANNELS
    assert len(values) == len(CHANNELS[topic].field_names) - 1
    assert isinstance(stamp_ns, int)


@pytest.mark.parametrize(
    "parts",
    [
        [b"/events", struct.pack("<qd", 1, float("inf")), b"x"],
        [b"/events", struct.pack("<qd", 1, float("nan")), b"x"],
        [b"json /events", b"[" * 100_000],
        [b"json /events", b'{"kind": 1, "detail": "a", "more": 2}'],
        [b"json /events", b"\xff\xfe"],
        [b"/camera/image", struct.pack("<q", 1), b"GIF89a"],
        [b"/camera/image", struct.pack("<q", 1)],
        [b"/seam/points", struct.pack("<q2d", 1, 2.0, 3.0)],
        [b"/seamlog/recorder", struct.pack("<q", 1)],
    ],
)
def test_what_cannot_be_logged(parts: list[bytes]) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        parse(parts)


def test_numbers_of_every_numeric_topic() -> None:
    for row in CHANNELS.values():
        count = {"/controller/state": 8}.get(row.topic, len(row.fields) - 1)
        simple = all(field.type in ("float64", "bool", "float64[8]") for field in row.fields[1:])
        if not simple or row.topic == "/seamlog/recorder":
            continue
        topic, stamp_ns, values = parse(
            [row.topic.encode(), struct.pack(f"<q{count}d", 3, *[1] * count)]
        )
        assert (topic, stamp_ns) == (row.topic, 3)
        assert len(values) == len(row.fields) - 1
