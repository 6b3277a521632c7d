"""The examples run as they stand."""

import subprocess
import sys
import tomllib
from pathlib import Path

from seamlog import open_session


def test_record_your_loop(project: Path, tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    words = [sys.executable, str(project / "examples" / "record_your_loop.py"), str(path)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    with open_session(path) as session:
        assert session.info.problems == []
        counts = {topic: channel.count for topic, channel in session.info.channels.items()}
        assert counts["/table/encoder"] == counts["/table/command"] == 100
        assert session.frames("/camera/image")[1].image().shape[:2] == (480, 640)
        assert len(session.info.welds) == 1


def test_example_maps_are_toml(project: Path) -> None:
    files = sorted((project / "examples").glob("*.toml"))
    assert files
    assert all(tomllib.loads(file.read_text()) for file in files)
