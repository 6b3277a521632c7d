"""Nothing that is there is ever replaced unasked."""

from pathlib import Path

import pytest

from seamlog.errors import OutputExists
from seamlog.recorder import Recorder
from tests.recorder.sessions import read_session

STAMP_NS = 1_767_225_600_000_000_000


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "weld.mcap"


def test_an_existing_session_is_left_alone(path: Path) -> None:
    path.write_bytes(b"precious")
    with pytest.raises(OutputExists, match="--force"):
        Recorder(path)
    assert path.read_bytes() == b"precious"
    with Recorder(path, force=True) as recorder:
        recorder.channel("/table/encoder").put(STAMP_NS, 1.0, 1.0)
        assert path.read_bytes() == b"precious"
    assert len(read_session(path)["/table/encoder"]) == 1


def test_an_unfinished_session_is_left_alone(path: Path) -> None:
    partial = path.with_name("weld.mcap.part")
    partial.write_bytes(b"precious")
    with pytest.raises(OutputExists, match="not finished"):
        Recorder(path)
    assert partial.read_bytes() == b"precious"
    with Recorder(path, force=True):
        pass
    assert not partial.exists()


def test_two_recorders_on_one_path(path: Path) -> None:
    with Recorder(path) as recorder:
        for force in (False, True):
            with pytest.raises(OutputExists):
                Recorder(path, force=force)
        recorder.channel("/table/encoder").put(STAMP_NS, 1.0, 1.0)
    assert len(read_session(path)["/table/encoder"]) == 1


def test_a_session_that_appears_meanwhile_is_not_replaced(path: Path) -> None:
    recorder = Recorder(path)
    recorder.channel("/table/encoder").put(STAMP_NS, 1.0, 1.0)
    path.write_bytes(b"precious")
    status = recorder.close()
    assert path.read_bytes() == b"precious"
    assert any(".part" in finding for finding in status.findings)
    assert len(read_session(path.with_name("weld.mcap.part"))["/table/encoder"]) == 1
