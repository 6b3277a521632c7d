"""One file of a recording: claimed under its `.part` name, written, sealed with its own name."""

import ctypes
import errno
import fcntl
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog import __version__
from seamlog.errors import OutputExists
from seamlog.mcap.records import Buffer
from seamlog.mcap.writer import FileWriter

from .storage import Storage

SPARE_BYTES = 256 << 10
"""Kept allocated behind the last chunk for the last accounts, the end record and the footer."""
_AHEAD_BYTES = (8 << 20, 1 << 20, 0)
"""How much is allocated ahead of what is needed now, less where the disk has no more."""
_LEAST_BYTES = SPARE_BYTES + (1 << 20)
"""No file is begun with less."""
_KEEP_SIZE = 1


def part_of(path: Path) -> Path:
    """Name of the session file `path` until it is finished."""
    return path.with_name(path.name + ".part")


def claim(partial: Path) -> int:
    """Create and lock `partial`; returns its descriptor, `OutputExists` if it is there."""
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    try:
        descriptor = os.open(partial, flags, 0o644)
    except FileExistsError:
        raise OutputExists(f"{partial} is being recorded by another process") from None
    fcntl.flock(descriptor, fcntl.LOCK_EX)
    return descriptor


def sync_folder(folder: Path) -> None:
    """Bring the names in `folder` to the disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class Segment:
    """One session file being written; whatever fails leaves whole records.

    The space for what is written next, and for the end of the file behind it, is allocated
    before: a full disk is met between two chunks and the file can still be finished.
    """

    def __init__(self, path: Path, descriptor: int, index: int, force: bool) -> None:
        self.path = path
        self.partial = part_of(path)
        self.index = index
        self.start_s = time.monotonic()
        self.is_doubtful = False
        """A sync of it has failed: it is never synced again."""
        self.is_named = False
        self.has_attachments = False
        self._force = force
        self._is_torn = False
        self._file = open(descriptor, "wb", buffering=0)  # noqa: SIM115 - open to the end
        try:
            self._reserved = allocate(descriptor, 0, _LEAST_BYTES)
            self._writer = FileWriter(self._file, f"seamlog {__version__}")
        except OSError:
            self._file.close()
            raise

    @property
    def size(self) -> int:
        """Bytes of whole records written so far."""
        return self._writer.size

    def is_full(self, storage: Storage) -> bool:
        """It is time for the next one."""
        age_s = time.monotonic() - self.start_s
        return self.size >= storage.largest_segment_bytes or age_s >= storage.segment_s

    @property
    def messages(self) -> int:
        """Messages written so far."""
        return self._writer.statistics.message_count

    @property
    def descriptor(self) -> int:
        """Of the open file."""
        return self._file.fileno()

    def add_channel(
        self, topic: str, channel_id: int, schema: tuple[str, str], metadata: Mapping[str, str]
    ) -> None:
        """Take in a channel; nothing is written yet."""
        number = self._writer.schema_id(*schema)
        self._writer.add_channel(topic, number, metadata, "cdr", channel_id)

    def write_chunk(
        self,
        channel_id: int,
        data: Buffer,
        log_times_ns: NDArray[np.uint64],
        offsets: NDArray[np.uint64],
        compression: str,
    ) -> None:
        """Write whole records as a chunk that stands alone; after an `OSError` it is not there."""
        self._do(
            len(data) + 16 * len(offsets),
            self._writer.write_chunk,
            (channel_id, data, log_times_ns, offsets, compression),
        )

    def attach(self, name: str, data: bytes, media_type: str, log_time_ns: int) -> None:
        """Write an attachment; after an `OSError` it is not there."""
        values = (name, data, media_type, log_time_ns, log_time_ns)
        self._do(len(data), self._writer.add_attachment, values)
        self.has_attachments = True

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record; after an `OSError` it is not there."""
        size = sum(len(key) + len(value) for key, value in values.items())
        self._do(4 * size, self._writer.add_metadata, (name, values))

    def use_reserve(self) -> None:
        """What is written from now on may take the space kept for the end of the file."""
        self._reserved = max(self._reserved, 1 << 62)

    def finish(self) -> None:
        """Write summary and footer and give back what was allocated behind them.

        After an `OSError` it may be tried again.
        """
        self.use_reserve()
        self._do(0, self._writer.finish, ())
        with suppress(OSError):
            os.ftruncate(self.descriptor, self._writer.size)

    def sync(self) -> None:
        """Bring all that was written to the disk, now."""
        os.fdatasync(self.descriptor)

    def take_name(self) -> None:
        """Give the finished file its name, on the disk too.

        `FileExistsError` if something of that name has appeared meanwhile; the segment then
        keeps its `.part` name.
        """
        if self._force:
            self.partial.replace(self.path)
        else:
            _rename_new(self.partial, self.path)
        self.is_named = True
        sync_folder(self.path.parent)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def discard(self) -> None:
        """Close and remove a file that holds no message."""
        self.close()
        self.partial.unlink(missing_ok=True)

    def _do(self, size: int, write: Callable[..., Any], values: tuple[Any, ...]) -> None:
        if self._is_torn:
            self._cut()
        end = self._writer.size + size + self._writer.summary_size + SPARE_BYTES
        if end > self._reserved:
            self._reserved = allocate(self.descriptor, self._reserved, end)
        try:
            write(*values)
        except OSError:
            with suppress(OSError):
                self._cut()
            raise

    def _cut(self) -> None:
        """Drop the torn record that a failed write left behind."""
        self._is_torn = True
        os.ftruncate(self.descriptor, self._writer.size)
        os.lseek(self.descriptor, self._writer.size, os.SEEK_SET)
        self._is_torn = False


def allocate(descriptor: int, start: int, end: int) -> int:
    """Allocate disk space from `start` to at least `end`, the size of the file left as it is.

    Returns where the allocated space ends, endless where the file system cannot allocate ahead;
    `OSError` ENOSPC if the disk is full.
    """
    for ahead in _AHEAD_BYTES:
        fault = _libc().fallocate(
            descriptor,
            _KEEP_SIZE,
            ctypes.c_int64(start),
            ctypes.c_int64(end + ahead - start),
        )
        if not fault:
            return end + ahead
        number = ctypes.get_errno()
        if number not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EINTR):
            return 1 << 62
    raise OSError(number, os.strerror(number))


@cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _rename_new(partial: Path, path: Path) -> None:
    """Rename without ever replacing; hard links do that, where the file system has them."""
    try:
        path.hardlink_to(partial)
    except FileExistsError:
        raise
    except OSError:
        if path.exists():
            raise FileExistsError(f"{path} has appeared during the recording") from None
        partial.rename(path)
    else:
        partial.unlink()
