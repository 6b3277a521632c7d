"""The session while it is recorded: a row of segments, of which the last one is being written."""

import errno
import os
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import CHANNELS
from seamlog.mcap.records import Buffer
from seamlog.messages import definition
from seamlog.segments import RECORDING, segment_path

from .folder import RESERVED, Recording
from .segment import Segment, claim, part_of, sync_folder
from .syncing import Syncer

CHUNK_BYTES = 256 << 10
"""A chunk closes at this size..."""
CHUNK_S = 0.07
"""...or at this age, by the recorder's own time: with a pass before and one after, within 0.1 s."""
_BUDGET_MARGIN_BYTES = 512 << 10


class SessionFile:
    """Writes chunks into the segment of the day; what fails ends a segment, never the session.

    After an `OSError` the message, attachment or record is in no file: do it again, and it goes
    into a new segment. `tell` takes findings in words, `farewell` writes the accounts that end
    each segment, `mark` (> 0, growing) is asked at each sync and comes back in `done_mark`.
    """

    def __init__(
        self,
        recording: Recording,
        folder: Path,
        descriptor: int,
        tell: Callable[[str], None] = lambda _: None,
        mark: Callable[[], int] = lambda: 1,
    ) -> None:
        self._recording = recording
        self._storage = recording.storage
        self._rings = folder
        self._descriptor: int | None = descriptor
        self._tell = tell
        self._mark = mark
        self.farewell: Callable[[], None] = lambda: None
        self._syncer = Syncer()
        self._channels: list[tuple[str, int, tuple[str, str], Mapping[str, str]]] = []
        self._metadata: list[tuple[str, Mapping[str, str]]] = []
        self._segment: Segment | None = None
        self._unfinished: dict[Segment, OSError] = {}
        self._is_sealing = False
        self._removed_messages = 0
        self._opened = 0
        self.segments: list[Segment] = []
        """Those that have ended and were not removed again."""
        with suppress(OSError):
            self._current()

    def add_channel(self, topic: str, channel_id: int, metadata: Mapping[str, str]) -> None:
        """Take in a channel of the table."""
        row = CHANNELS[topic]
        values = (topic, channel_id, (row.schema, definition(row)), dict(metadata))
        self._channels.append(values)
        if self._segment is not None:
            self._segment.add_channel(*values)

    def write_chunk(
        self,
        channel_id: int,
        data: Buffer,
        log_times_ns: NDArray[np.uint64],
        offsets: NDArray[np.uint64],
        compression: str,
    ) -> bool:
        """Write whole records as a chunk that stands alone."""
        values = (channel_id, data, log_times_ns, offsets, compression)
        self._write(lambda segment: segment.write_chunk(*values))
        return True

    def attach(self, name: str, data: bytes, media_type: str, log_time_ns: int) -> None:
        """Write an attachment."""
        self._write(lambda segment: segment.attach(name, data, media_type, log_time_ns))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record."""
        self._write(lambda segment: segment.add_metadata(name, values))
        self._metadata.append((name, values))

    @property
    def size(self) -> int:
        """Bytes of all segments that are there."""
        done = sum(segment.size for segment in self.segments)
        return done + (self._segment.size if self._segment else 0)

    @property
    def is_over_budget(self) -> bool:
        """The disk budget is used up, or will be with what is on its way."""
        budget = self._storage.budget_bytes
        return budget is not None and self.size + _BUDGET_MARGIN_BYTES > budget

    @property
    def done_mark(self) -> int:
        """Mark of the last sync that is on the disk."""
        return self._syncer.done_mark

    @property
    def is_durable(self) -> bool:
        """No sync has failed so far."""
        return self._syncer.is_durable

    def free_bytes(self) -> int:
        """Free space of the file system that holds the session."""
        try:
            return shutil.disk_usage(Path(self._recording.path).parent).free
        except OSError:
            return 0

    def request_sync(self) -> None:
        """Bring what is written by now to the disk, soon."""
        if self._segment is not None and not self._segment.is_doubtful:
            self._syncer.sync(self._segment, self._mark())

    def watch(self) -> list[str]:
        """Troubles of syncing since the last look; a segment whose sync failed ends here."""
        troubles = self._syncer.take_troubles()
        if self._segment is not None and self._segment.is_doubtful:
            self._seal()
        return troubles

    def finish(self) -> list[str]:
        """End the last segment and wait until all are on the disk; troubles in words."""
        if self._segment is not None:
            self._seal()
        self._finish_the_rest()
        for segment, error in self._unfinished.items():
            self._tell(f"{segment.partial} could not be finished and keeps this name: {error}")
            self._syncer.leave(segment)
        self._syncer.end()
        self._remove_stale()
        return self._syncer.take_troubles()

    def _write(self, act: Callable[[Segment], None]) -> None:
        segment = self._current()
        try:
            act(segment)
        except OSError as error:
            if not self._is_sealing:
                self._abandon(segment, error)
            raise
        if not self._is_sealing:
            self._keep_limits(segment)

    def _current(self) -> Segment:
        if self._segment is None:
            self._segment = self._open()
            self._opened += 1
            self._introduce(self._segment)
            self._finish_the_rest()
        return self._segment

    def _open(self) -> Segment:
        path = Path(self._recording.path)
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is None:
            path, descriptor = self._claim_next(path)
        try:
            return Segment(path, descriptor, self._opened + 1, self._recording.force)
        except OSError:
            part_of(path).unlink(missing_ok=True)
            raise

    def _claim_next(self, first: Path) -> tuple[Path, int]:
        """The next name that nobody uses; one of an earlier recording is replaced with force."""
        number = self._opened + 1
        while True:
            path = segment_path(first, number)
            taken = part_of(path).exists() or (path.exists() and not self._recording.force)
            if not taken:
                descriptor = claim(part_of(path))
                with suppress(OSError):
                    sync_folder(path.parent)
                return path, descriptor
            number += 1

    def _introduce(self, segment: Segment) -> None:
        row = self._recording
        facts = (row.id, segment.index, row.start_ns, row.pace, self._rings, row.pid)
        own = {key: str(value) for key, value in zip(RESERVED, facts, strict=True)}
        removed = segment.index - 1 - len(self.segments)
        if removed:
            own |= {"removed": str(removed), "removed_messages": str(self._removed_messages)}
        try:
            segment.add_metadata(RECORDING, dict(row.meta) | own)
            if self._storage.over_budget == "oldest":
                for name, values in self._metadata:
                    segment.add_metadata(name, values)
        except OSError as error:
            self._abandon(segment, error)
            raise
        for channel in self._channels:
            segment.add_channel(*channel)

    def _keep_limits(self, segment: Segment) -> None:
        if segment.is_full(self._storage):
            self._seal()
        if self._storage.over_budget == "oldest":
            while self.is_over_budget and self._remove_oldest():
                pass

    def _abandon(self, segment: Segment, error: OSError) -> None:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            self._tell(f"the disk is full, messages wait in memory: {error}")
        else:
            self._tell(
                f"{segment.partial}: writing failed at byte {segment.size} and goes on in a new "
                f"file: {error}"
            )
        if segment.messages or segment.has_attachments:
            self._seal()
        else:
            segment.discard()
            self._segment = None
            self._opened -= 1

    def _seal(self) -> None:
        """End the segment: accounts, summary, then sync and name in the thread for it."""
        segment = self._segment
        assert segment is not None
        segment.use_reserve()
        self._is_sealing = True
        with suppress(OSError):
            self.farewell()
        self._is_sealing = False
        self._segment = None
        self.segments.append(segment)
        self._finish(segment)

    def _finish(self, segment: Segment) -> None:
        try:
            segment.finish()
        except OSError as error:
            self._unfinished[segment] = error
        else:
            self._syncer.seal(segment, self._mark())

    def _finish_the_rest(self) -> None:
        """Segments that could not be finished when the disk failed: it may work now."""
        rest, self._unfinished = self._unfinished, {}
        for segment in rest:
            self._finish(segment)

    def _remove_oldest(self) -> bool:
        for segment in self.segments:
            if segment.is_named and not segment.has_attachments:
                with suppress(OSError):
                    segment.path.unlink()
                self.segments.remove(segment)
                self._removed_messages += segment.messages
                return True
        return False

    def _remove_stale(self) -> None:
        """With force: what an earlier recording of this name left behind the last segment."""
        number = max(self._opened, 1) + 1
        while self._recording.force:
            path = segment_path(Path(self._recording.path), number)
            if not path.exists():
                return
            path.unlink()
            number += 1


def written_files(file: SessionFile) -> list[str]:
    """Paths of the segments, under the names that they have now."""
    return [os.fspath(row.path if row.is_named else row.partial) for row in file.segments]
