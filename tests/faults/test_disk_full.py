"""A disk that fills up: what is there is a whole session, and space brings the recording back."""

import gc
import os
import time
from pathlib import Path

import pytest

from seamlog.cli import run
from seamlog.recorder import Recorder, Status
from seamlog.recorder.folder import abandoned_folders, root
from tests.faults.accounts import check_identities, ring_stamps, session_stamps

MIB = 1 << 20


def fill(folder: Path, leave: int) -> Path:
    """Take the space of `folder` but for `leave` bytes."""
    ballast = folder / "ballast"
    size = 12 * MIB - leave
    with ballast.open("wb") as file:
        for _ in range(size // 65536):
            file.write(bytes(65536))
    return ballast


def put_until_full(recorder: Recorder, accepted: list[int], seconds: float = 60.0) -> int:
    """Put messages until the recorder says that the disk is full; returns when.

    Stamps are monotonic time in nanoseconds, as what is returned.
    """
    encoder = recorder.channel("/table/encoder")
    end = time.monotonic() + seconds
    number = 0
    while not any("disk is full" in finding for finding in recorder.status().findings):
        assert time.monotonic() < end
        for _ in range(50):
            number += 1
            # Values that zstd cannot shrink.
            stamp = time.monotonic_ns()
            if encoder.put(stamp, (number * 0.7548776662) % 1, (number * 0.5698402910) % 1):
                accepted.append(stamp)
        time.sleep(0.001)
    return time.monotonic_ns()


def test_what_is_on_a_full_disk_is_a_whole_session(small_disk: Path) -> None:
    ballast = fill(small_disk, 3 * MIB)
    accepted: list[int] = []
    recorder = Recorder(small_disk / "weld.mcap")
    put_until_full(recorder, accepted)
    status = recorder.close()
    check_identities(status)
    (row,) = status.channels
    found = session_stamps(small_disk / "weld.mcap")["/table/encoder"]
    assert row.accepted == len(accepted) > row.written == len(found) > 0
    assert found == accepted[: row.written]
    assert accepted[row.written :] == ring_stamps(root() / status.recording_id)["/table/encoder"]
    assert not list(small_disk.glob("*.part"))
    assert row.lost == 0
    assert any(str(root()) in finding for finding in status.findings)
    # The next recording does not take the rings for left-overs, and recover joins both.
    folder = root() / status.recording_id
    os.utime(folder, (0, 0))
    assert folder in abandoned_folders()
    ballast.unlink()
    del recorder
    gc.collect()
    recovered = small_disk / "whole.mcap"
    run(["recover", str(small_disk / "weld.mcap"), "-o", str(recovered)])
    assert session_stamps(recovered)["/table/encoder"] == accepted


def test_space_that_comes_back_brings_the_recording_back(small_disk: Path) -> None:
    ballast = fill(small_disk, 3 * MIB)
    accepted: list[int] = []
    recorder = Recorder(small_disk / "weld.mcap")
    put_until_full(recorder, accepted)
    ballast.unlink()
    time.sleep(0.3)
    encoder = recorder.channel("/table/encoder")
    last = accepted[-1]
    for number in range(last + 1, last + 1001):
        assert encoder.put(number, 0.0, 0.0)
        accepted.append(number)
    status = recorder.close()
    check_identities(status)
    assert status.channels[0].written == len(accepted)
    assert len(status.files) == 2
    assert session_stamps(small_disk / "weld.mcap")["/table/encoder"] == accepted


def test_a_disk_without_room_from_the_start(small_disk: Path) -> None:
    fill(small_disk, 64 << 10)
    with Recorder(small_disk / "weld.mcap") as recorder:
        encoder = recorder.channel("/table/encoder")
        answers = [encoder.put(number, 0.0, 0.0) for number in range(100)]
    status = recorder.close()
    assert all(answers)
    check_identities(status)
    assert (status.channels[0].accepted, status.channels[0].written) == (100, 0)
    assert any("in /dev/shm" in finding for finding in status.findings)
    rest = ring_stamps(root() / status.recording_id)["/table/encoder"]
    assert rest == list(range(100))


def test_the_loop_is_warned_while_there_is_time(
    small_disk: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with Recorder(small_disk / "weld.mcap") as recorder:
        events = recorder.channel("/events")
        end = time.monotonic() + 30
        while "nearly full" not in caplog.text:
            assert time.monotonic() < end
            for _ in range(20):
                events.put(1, 7, f"{time.monotonic_ns() * 0x9E3779B97F4A7C15:x}" * 20)
            time.sleep(0.01)
    status: Status = recorder.close()
    assert status.is_complete
    details = session_stamps(small_disk / "weld.mcap")
    assert len(details["/events"]) > 1
