"""Long recordings become several files; a disk budget removes the oldest or ends the recording."""

import os
from pathlib import Path

import pytest

from seamlog import open_session
from seamlog.errors import OutputExists, UsageError
from seamlog.recorder import Recorder, Storage
from seamlog.recorder.accounts import Status
from tests.recorder.sessions import final_accounts, read_metadata

COUNT = 120_000
MIB = 1 << 20


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "weld.mcap"


def record(path: Path, storage: Storage, count: int = COUNT, force: bool = False) -> Status:
    noise = os.urandom(16)
    with Recorder(path, pace="simulated", storage=storage, force=force) as recorder:
        encoder = recorder.channel("/table/encoder", {"unit": "m"})
        events = recorder.channel("/events")
        for i in range(count):
            encoder.put(i, i * 0.1, float(noise[i % 16]) * i)
        events.put(count, 7, "end")
    return recorder.close()


def test_a_long_recording_is_one_session_in_several_files(path: Path) -> None:
    status = record(path, Storage(segment_bytes=MIB))
    assert status.is_complete
    assert len(status.files) > 2
    indexes = [read_metadata(Path(file))["seamlog.recording"]["index"] for file in status.files]
    assert indexes == [str(n + 1) for n in range(len(status.files))]
    sizes = [Path(file).stat().st_size for file in status.files]
    assert all(MIB <= size < 1.6 * MIB for size in sizes[:-1])
    for file in status.files:
        with open_session(file) as session:
            assert session.columns("/table/encoder")["stamp_ns"].tolist() == list(range(COUNT))
            assert session.columns("/events")["detail"].tolist()[-1] == "end"
            assert session.problems == []
        row = final_accounts(Path(file))["/table/encoder"]
        assert row.offered == row.accepted + row.dropped + row.refused
        assert row.lost == 0
    assert not list(path.parent.glob("*.part"))


def test_a_file_ends_after_its_time(path: Path) -> None:
    status = record(path, Storage(segment_s=0.05))
    assert len(status.files) > 1
    stamps = [stamp for file in status.files for stamp in encoder_of(file)]
    assert stamps == list(range(COUNT))


def test_a_budget_removes_the_oldest_files_and_the_rest_says_so(path: Path) -> None:
    status = record(path, Storage(budget_bytes=4 * MIB, over_budget="oldest"), 300_000)
    assert status.is_complete
    assert sum(file.stat().st_size for file in path.parent.iterdir()) <= 4 * MIB
    assert not path.exists()
    files = [Path(file) for file in status.files]
    assert sorted(path.parent.iterdir()) == files
    stamps = [stamp for file in files for stamp in encoder_of(file)]
    assert stamps == list(range(300_000 - len(stamps), 300_000))
    facts = read_metadata(files[-1])["seamlog.recording"]
    assert int(facts["index"]) - int(facts["removed"]) <= len(files) + 1


def test_a_budget_ends_the_recording_and_every_message_is_accounted_for(path: Path) -> None:
    status = record(path, Storage(budget_bytes=4 * MIB), 300_000)
    row = status.channels[0]
    assert row.offered == 300_000 == row.accepted + row.refused
    kept = [stamp for file in status.files for stamp in encoder_of(file)]
    assert row.accepted == row.written == len(kept)
    assert row.refused > 0
    assert "budget of 4 MiB is used up" in row.reason
    assert any("budget" in finding for finding in status.findings)
    # What the ring held when the budget was used up is still written.
    assert sum(Path(file).stat().st_size for file in status.files) < 4 * MIB + (3 << 20)


def test_files_of_an_earlier_recording_are_not_replaced_unasked(path: Path) -> None:
    record(path, Storage(segment_bytes=MIB))
    path.unlink()
    with pytest.raises(OutputExists, match=r"0002"):
        Recorder(path)
    status = record(path, Storage(), 10, force=True)
    assert [Path(file).name for file in status.files] == ["weld.mcap"]
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize(
    "values",
    [
        {"sync": "often"},
        {"segment_bytes": 10},
        {"segment_s": 0},
        {"budget_bytes": MIB},
        {"over_budget": "newest"},
    ],
)
def test_rules_that_make_no_sense_are_told(values: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        Storage(**values)  # type: ignore[arg-type]


def encoder_of(path: str | Path) -> list[int]:
    with open_session([path]) as session:
        return [int(stamp) for stamp in session.columns("/table/encoder")["stamp_ns"]]
