"""The session file while it is recorded: chunks, syncs, and its name at the end."""

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seamlog import __version__
from seamlog.channels import CHANNELS
from seamlog.mcap.records import Buffer
from seamlog.mcap.writer import FileWriter
from seamlog.messages import definition
from seamlog.segments import RECORDING

from .folder import RESERVED, Recording

CHUNK_BYTES = 256 << 10
"""A chunk closes at this size..."""
CHUNK_S = 0.1
"""...or at this age, by the recorder's own time."""


class SessionFile:
    """A session being written under its `.part` name; whatever fails leaves whole records."""

    def __init__(self, recording: Recording, folder: Path, descriptor: int) -> None:
        self._recording = recording
        self._file = open(descriptor, "wb", buffering=0)  # noqa: SIM115 - open to the end
        self._writer = FileWriter(self._file, f"seamlog {__version__}")
        facts = (recording.id, 1, recording.start_ns, recording.pace, folder, recording.pid)
        own = {key: str(value) for key, value in zip(RESERVED, facts, strict=True)}
        self._writer.add_metadata(RECORDING, dict(recording.meta) | own)

    def add_channel(self, topic: str, channel_id: int, metadata: Mapping[str, str]) -> None:
        """Take in a channel of the table."""
        row = CHANNELS[topic]
        schema = self._writer.schema_id(row.schema, definition(row))
        self._writer.add_channel(topic, schema, metadata, "cdr", channel_id)

    def write_chunk(
        self,
        channel_id: int,
        data: Buffer,
        log_times_ns: NDArray[np.uint64],
        offsets: NDArray[np.uint64],
        compression: str,
    ) -> None:
        """Write whole records as a chunk that stands alone; after an `OSError` it is not there."""
        try:
            self._writer.write_chunk(channel_id, data, log_times_ns, offsets, compression)
        except OSError:
            self._cut()
            raise

    def attach(self, name: str, data: bytes, media_type: str, log_time_ns: int) -> None:
        """Write an attachment; after an `OSError` it is not there."""
        try:
            self._writer.add_attachment(name, data, media_type, log_time_ns, log_time_ns)
        except OSError:
            self._cut()
            raise

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record; after an `OSError` it is not there."""
        try:
            self._writer.add_metadata(name, values)
        except OSError:
            self._cut()
            raise

    @property
    def size(self) -> int:
        """Bytes of whole records written so far."""
        return self._writer.size

    @property
    def descriptor(self) -> int:
        """Of the open file."""
        return self._file.fileno()

    def free_bytes(self) -> int:
        """Free space of the file system that holds the session."""
        facts = os.fstatvfs(self._file.fileno())
        return facts.f_bavail * facts.f_frsize

    def finish(self) -> None:
        """Write summary and footer; after an `OSError` they are not there."""
        try:
            self._writer.finish()
        except OSError:
            self._cut()
            raise

    def sync(self) -> None:
        """Bring all that was written to the disk, now."""
        os.fsync(self._file.fileno())

    def take_name(self) -> None:
        """Give the finished file its name.

        `FileExistsError` if something of that name has appeared meanwhile; the session then
        keeps its `.part` name.
        """
        _rename(self._recording.partial, Path(self._recording.path), self._recording.force)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _cut(self) -> None:
        """Drop the torn record that a failed write left behind."""
        descriptor = self._file.fileno()
        with suppress(OSError):
            os.ftruncate(descriptor, self._writer.size)
            os.lseek(descriptor, self._writer.size, os.SEEK_SET)


def _rename(partial: Path, path: Path, force: bool) -> None:
    if force:
        partial.replace(path)
    else:
        _rename_new(partial, path)
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


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
