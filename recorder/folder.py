"""The folder of a recording in shared memory: rings, and what else the loop hands over.

    /dev/shm/seamlog-<uid>/<recording id>/
        recording.json          what is recorded, where to, by whom
        lock                    locked while the loop or the recorder process lives
        tray                    locked while a loop places an item
        000001.json             an item: a channel, an attachment or a metadata record
        000001.ring, .data      what belongs to it

Items are numbered and appear by rename, so they are whole, in order, and outlive the loop.
"""

import fcntl
import glob
import json
import os
import shutil
import stat
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from seamlog.contracts import Pace
from seamlog.errors import HardwareError, SpaceMissing, UsageError

from .ring import holds_messages
from .segment import part_of
from .storage import Snapshot, Storage

RESERVED = ("id", "index", "start_ns", "pace", "ring_path", "producer")
"""Keys of the metadata record `seamlog.recording` which are not the user's."""
_SETTLED_S = 60.0
"""A folder younger than this may be about to be locked by its owner."""


@dataclass(frozen=True, slots=True)
class Recording:
    """What the recorder process must know; `anchor_ns` turns monotonic time into log time.

    Without an anchor the clock is not ours to read: log time is then that of the newest message.
    """

    id: str
    path: str
    start_ns: int
    pace: Pace
    anchor_ns: int | None
    force: bool
    pid: int
    meta: Mapping[str, str]
    storage: Storage = field(default_factory=Storage)
    snapshot: Snapshot | None = None

    @property
    def partial(self) -> Path:
        """Name of the first file until it is finished."""
        return part_of(Path(self.path))


def root() -> Path:
    """The folder of all recordings of this user, made if needed; `HardwareError` if impossible."""
    if not sys.platform.startswith("linux"):
        raise HardwareError(
            "recording needs the shared memory of Linux; record on a Linux machine and bring "
            "the session here"
        )
    folder = Path("/dev/shm") / f"seamlog-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    facts = folder.lstat()
    if facts.st_uid != os.getuid() or not stat.S_ISDIR(facts.st_mode):
        raise HardwareError(f"{folder} belongs to another user; have it removed")
    return folder


def make_folder(recording: Recording) -> tuple[Path, int]:
    """Make and lock the folder of a recording; returns it and the descriptor of its lock."""
    folder = root() / recording.id
    folder.mkdir(mode=0o700)
    lock = os.open(folder / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    fcntl.flock(lock, fcntl.LOCK_EX)
    _place(folder / "recording.json", json.dumps(asdict(recording)).encode())
    return folder, lock


def read_recording(folder: Path) -> Recording:
    """What `make_folder` wrote."""
    document = json.loads((folder / "recording.json").read_bytes())
    storage, snapshot = Storage(**document.get("storage", {})), document.get("snapshot")
    if snapshot is not None:
        tuples = {key: tuple(snapshot[key]) for key in ("events", "rules")}
        snapshot = Snapshot(**snapshot | tuples)
    return Recording(**document | {"storage": storage, "snapshot": snapshot})


def abandoned_folders() -> list[Path]:
    """Folders of recordings whose processes are all dead.

    Kept and returned are those of which a session file is unfinished, or some file is there and
    messages wait in the rings; those of other versions are left alone, the others removed.
    """
    kept = []
    for folder in root().iterdir():
        if not _is_abandoned(folder):
            continue
        try:
            wanted = _is_wanted(folder, Path(read_recording(folder).path))
        except FileNotFoundError:
            wanted = False
        except (OSError, ValueError, TypeError, KeyError, UsageError):
            continue
        if wanted:
            kept.append(folder)
        else:
            shutil.rmtree(folder, ignore_errors=True)
    return kept


def _is_wanted(folder: Path, session: Path) -> bool:
    files = list(session.parent.glob(f"{glob.escape(session.stem)}*.mcap*"))
    if any(path.suffix == ".part" for path in files):
        return True
    waiting = any(holds_messages(ring) for ring in folder.glob("*.ring"))
    return bool(files) and (waiting or any(folder.glob("*.data")))


def is_locked(folder: Path) -> bool:
    """True while the loop or the recorder process of a recording lives."""
    lock = os.open(folder / "lock", os.O_RDWR | os.O_CLOEXEC)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(lock)
    return False


def _is_abandoned(folder: Path) -> bool:
    try:
        if time.time() - folder.stat().st_mtime < _SETTLED_S:
            return False
        return not is_locked(folder)
    except OSError:
        return False


def _place(path: Path, data: bytes) -> None:
    partial = path.with_suffix(".new")
    partial.write_bytes(data)
    partial.rename(path)


class OutTray:
    """Where loops put items; any thread and process may, one at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = threading.RLock()
        self._depth = 0
        self._next = 1

    @contextmanager
    def turn(self) -> Iterator[int]:
        """Be the one who places the next item; yields its number."""
        with self._lock, ExitStack() as stack:
            if not self._depth:
                gate = os.open(self.folder / "tray", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
                stack.callback(os.close, gate)
                fcntl.flock(gate, fcntl.LOCK_EX)
                while (self.folder / f"{self._next:06d}.json").exists():
                    self._next += 1
            self._depth += 1
            try:
                yield self._next
            finally:
                self._depth -= 1

    def next_path(self, suffix: str) -> Path:
        """Path for what belongs to the next item; in a turn that ends after it is placed."""
        return self.folder / f"{self._next:06d}{suffix}"

    def place_data(self, data: bytes) -> str:
        """Store `data` for the next item and return its file name; in a turn."""
        file = self.next_path(".data")
        try:
            file.write_bytes(data)
        except OSError as error:
            file.unlink(missing_ok=True)
            size = f"{len(data) / 2**20:.1f} MiB"
            raise SpaceMissing(f"{file.parent} has no room for {size}: {error}") from error
        return file.name

    def place(self, item: Mapping[str, Any]) -> None:
        """Hand over `item`."""
        with self.turn():
            _place(self.next_path(".json"), json.dumps(item).encode())
            self._next += 1


def iter_items(folder: Path, first: int) -> Iterator[tuple[int, dict[str, Any]]]:
    """Items from number `first` on, as far as they are there."""
    number = first
    while True:
        try:
            item = json.loads((folder / f"{number:06d}.json").read_bytes())
        except FileNotFoundError:
            return
        yield number, item
        number += 1
