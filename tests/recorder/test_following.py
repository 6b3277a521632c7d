"""A session that is read while it grows: in its last file, in new files, and at its end."""

import json
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from seamlog import open_session
from seamlog.recorder import Recorder, Storage

TOPIC = "/table/encoder"


def wait_until_written(recorder: Recorder) -> None:
    deadline = time.monotonic() + 30
    while any(row.waiting for row in recorder.status().channels):
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.parametrize("segment_s", [600.0, 0.2])
def test_a_session_grows_while_it_is_recorded(tmp_path: Path, segment_s: float) -> None:
    path = tmp_path / "weld.mcap"
    recorder = Recorder(path, storage=Storage(segment_s=segment_s))
    put = recorder.channel(TOPIC).put
    put(0, 0.0, 0.0)
    wait_until_written(recorder)
    with open_session(path) as session:
        assert session.columns(TOPIC)["stamp_ns"].tolist() == [0]
        window = session.window(0, 1 << 62)
        before = window.columns(TOPIC)["stamp_ns"].tolist()
        for last in range(200, 1001, 200):
            for number in range(last - 199, last + 1):
                put(number, 0.0, 0.0)
            wait_until_written(recorder)
            assert session.is_being_recorded
            assert session.grow()
            assert session.columns(TOPIC)["stamp_ns"].tolist() == list(range(last + 1))
            assert session.info.channels[TOPIC].count == last + 1
        assert before == [0]
        status = recorder.close()
        assert session.grow()
        assert not session.is_being_recorded
        assert session.problems == []
        assert [str(file) for file in session.paths] == list(status.files)
        assert session.metadata["seamlog.recording.end"] == {"ending": "closed"}
        assert not session.grow()
    assert (len(status.files) > 1) == (segment_s < 1)


def test_a_session_grows_while_its_file_gets_another_name(tmp_path: Path) -> None:
    path = tmp_path / "weld.mcap"
    with Recorder(path) as recorder:
        recorder.channel(TOPIC).put(0, 0.0, 0.0)
    unfinished = path.with_name(path.name + ".part")
    ended = threading.Event()

    def rename() -> None:
        while not ended.is_set():
            path.rename(unfinished)
            unfinished.rename(path)

    with open_session(path) as session:
        renaming = threading.Thread(target=rename)
        renaming.start()
        try:
            for _ in range(300):
                session.grow()
                assert session.columns(TOPIC)["stamp_ns"].tolist() == [0]
        finally:
            ended.set()
            renaming.join()


def test_info_follows_until_the_end(tmp_path: Path) -> None:
    path = tmp_path / "weld.mcap"
    recorder = Recorder(path)
    put = recorder.channel(TOPIC).put
    put(0, 0.0, 0.0)
    wait_until_written(recorder)
    command = [sys.executable, "-m", "seamlog", "info", str(path), "--follow", "--json"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as info:
        assert info.stderr is not None
        assert "messages (+" in info.stderr.readline()
        for number in range(1, 500):
            put(number, 0.0, 0.0)
        recorder.close()
        output, errors = info.communicate(timeout=60)
    assert info.returncode == 0, errors
    found = json.loads(output)
    counts = {row["topic"]: row["count"] for row in found["channels"]}
    assert counts[TOPIC] == 500
    assert found["paths"] == [str(path)]


def test_a_session_that_is_not_recorded_does_not_grow(tmp_path: Path) -> None:
    with Recorder(tmp_path / "weld.mcap") as recorder:
        recorder.channel(TOPIC).put(0, 0.0, 0.0)
    with open_session(tmp_path / "weld.mcap") as session:
        assert not session.is_being_recorded
        assert not session.grow()
