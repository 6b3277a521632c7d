"""What the rings of a dead recording still hold, taken into a recovered session."""

import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from seamlog.channels import CHANNELS, IMAGE_SCHEMA
from seamlog.errors import SpaceMissing, UsageError
from seamlog.messages import encode

from .accounts import Account, ring_account
from .feeds import Feed, FixedFeed
from .folder import Recording, iter_items, read_recording, root
from .journal import STATUS_ID
from .journal import status_values as values_of
from .pictures import message_record, picture_encoder
from .recovery_file import RecoveredFile
from .ring import open_ring
from .varying_feed import VaryingFeed

_PATIENCE_S = 2.0
_STATUS = CHANNELS["/seamlog/recorder"]


@dataclass(frozen=True, slots=True)
class Rings:
    """The folder in shared memory of a recording that nobody writes any more."""

    folder: Path
    recording: Recording

    def remove(self) -> None:
        """Give the shared memory back."""
        shutil.rmtree(self.folder, ignore_errors=True)


def find_rings(path: Path, recording_id: str | None) -> Rings | None:
    """Rings of the recording `recording_id`, or of the one that wrote `path`; None if none.

    `UsageError` if the recording still runs.
    """
    if not Path("/dev/shm").is_dir():
        return None
    for folder in sorted(root().iterdir()):
        try:
            recording = read_recording(folder)
        except (OSError, ValueError, TypeError, KeyError, UsageError):
            continue
        is_it = recording.partial == path.absolute()
        if recording.id == recording_id or (recording_id is None and is_it):
            _refuse_living(folder, recording, path)
            return Rings(folder, recording)
    return None


def _refuse_living(folder: Path, recording: Recording, path: Path) -> None:
    if not _is_free(folder / "lock"):
        raise UsageError(f"{path} is being recorded; end the recording first")
    metadata = (item.get("metadata", {}) for _, item in iter_items(folder, 1))
    joined = {int(row["producer_pid"]) for row in metadata if "producer_pid" in row}
    for pid in sorted({recording.pid, *joined}):
        if _maps(pid, folder):
            raise UsageError(
                f"{path}: process {pid} still logs into {folder}, though its recorder process is "
                "gone; end it first"
            )


def _is_free(path: Path) -> bool:
    """True once nobody holds the lock; a process that was killed just now may still be going."""
    lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    deadline_s = time.monotonic() + _PATIENCE_S
    try:
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return True
            except BlockingIOError:
                if time.monotonic() > deadline_s:
                    return False
                time.sleep(0.05)
    finally:
        os.close(lock)


def _maps(pid: int, folder: Path) -> bool:
    """True if process `pid` has a file of `folder` mapped."""
    try:
        return f"{folder}/" in Path(f"/proc/{pid}/maps").read_text(errors="replace")
    except OSError:
        return False


def define_channels(rings: Rings, file: RecoveredFile) -> None:
    """Take in the channels of the rings: chunks whose channel records are gone find them here."""
    for _, item in iter_items(rings.folder, 1):
        if item["kind"] == "channel":
            file.add_channel(item["topic"], item["channel_id"], item["metadata"])
    file.add_channel(_STATUS.topic, STATUS_ID, {"producer": "recorder"})


def drain(rings: Rings, file: RecoveredFile, missing: Mapping[int, int]) -> dict[int, Account]:
    """Write what the rings hold behind what `file` has, and the final accounts.

    `define_channels` has told the file of theirs. The rings stay as they are until the session is
    safe: a copy is drained. `missing` are sequences by channel id that the file skips: dropped
    while recording, or lost by damage.
    """
    with _copied(rings.folder) as folder:
        feeds = list(_take_items(folder, file))
        for feed in feeds:
            while feed.pump(time.monotonic(), True):
                pass
    in_snapshots = rings.recording.snapshot is not None
    accounts = {
        feed.channel_id: _final(feed, missing.get(feed.channel_id, 0), in_snapshots)
        for feed in feeds
    }
    _write_accounts(file, list(accounts.values()))
    return accounts


@contextmanager
def _copied(folder: Path) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="seamlog-recover-") as place:
        try:
            yield Path(shutil.copytree(folder, Path(place) / "rings"))
        except shutil.Error as error:
            raise SpaceMissing(f"{place} has no room for a copy of {folder}: {error}") from error


def _take_items(folder: Path, file: RecoveredFile) -> Iterator[Feed]:
    for _, item in iter_items(folder, 1):
        if item["kind"] == "channel":
            yield _feed(folder, item, file)
        elif item["kind"] == "metadata":
            file.add_metadata(item["name"], item["values"])
        elif item["kind"] == "attachment" and (folder / item["data"]).exists():
            # A file that is gone has been written, and with it its item.
            data = (folder / item["data"]).read_bytes()
            file.attach(item["name"], data, item["media_type"], item["log_time_ns"])


def _feed(folder: Path, item: dict[str, Any], file: RecoveredFile) -> Feed:
    topic, channel_id, metadata = item["topic"], item["channel_id"], item["metadata"]
    ring = open_ring(folder / item["ring"])
    producer = metadata.get("producer", "")
    if ring.stride:
        return FixedFeed(channel_id, topic, producer, ring, file)
    is_picture = CHANNELS[topic].schema == IMAGE_SCHEMA
    encoder = picture_encoder(channel_id) if is_picture else None
    return VaryingFeed(channel_id, topic, producer, ring, file, encoder)


def _final(feed: Feed, missing: int, in_snapshots: bool) -> Account:
    """Accepted = written + lost; with all rings drained, what is not lost has been written."""
    ring = feed.ring
    seen = feed.account()
    # A loop may die between publishing a message and counting it.
    account = ring_account(feed.topic, seen.producer, ring, max(ring.accepted, seen.accepted))
    lost = account.lost + max(0, missing - account.dropped - account.discarded)
    if in_snapshots:
        # What waited in the memory of the recorder process belonged to no snapshot yet.
        rest = account.accepted - account.written - lost
        return replace(account, lost=lost, discarded=max(0, rest))
    return replace(account, lost=lost, written=account.accepted - lost)


def _write_accounts(file: RecoveredFile, accounts: list[Account]) -> None:
    if not accounts:
        return
    time_ns, first = file.newest_ns, file.last_sequence(STATUS_ID) + 1
    records = [
        message_record(
            STATUS_ID, first + i, time_ns, time_ns, encode(_STATUS, (time_ns, *values_of(row, 0)))
        )
        for i, row in enumerate(accounts)
    ]
    ends = np.cumsum([0, *map(len, records)], dtype=np.uint64)
    times = np.full(len(records), time_ns, np.uint64)
    file.write_chunk(STATUS_ID, b"".join(records), times, ends[:-1], "zstd")
