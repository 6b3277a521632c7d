"""Syncs and names files in a thread of its own: a slow disk holds up neither rings nor chunks."""

import threading
from collections import deque
from dataclasses import dataclass
from typing import Literal

from .segment import Segment


@dataclass(slots=True)
class _Job:
    segment: Segment
    act: Literal["sync", "seal", "leave"]
    mark: int


class Syncer:
    """Does what is asked in order; several syncs asked for during one become one more.

    A sync that failed is never tried again: what it had to bring to disk may be gone for good.
    """

    def __init__(self) -> None:
        self._jobs: deque[_Job] = deque()
        self._changed = threading.Condition()
        self._is_ending = False
        self._troubles: deque[str] = deque()
        self.done_mark = 0
        """Mark of the last request that is on the disk, as all before it."""
        self.is_durable = True
        """No sync has failed so far."""
        self._thread = threading.Thread(target=self._run, name="sync", daemon=True)
        self._thread.start()

    def sync(self, segment: Segment, mark: int) -> None:
        """Sync what is written by now; `mark` (> 0) tells this request from others."""
        with self._changed:
            if self._jobs and self._jobs[-1].act == "sync" and self._jobs[-1].segment is segment:
                self._jobs[-1].mark = mark
                return
        self._add(_Job(segment, "sync", mark))

    def seal(self, segment: Segment, mark: int) -> None:
        """Sync a finished segment, give it its name and close it."""
        self._add(_Job(segment, "seal", mark))

    def leave(self, segment: Segment) -> None:
        """Close a segment that could not be finished; it keeps its `.part` name."""
        self._add(_Job(segment, "leave", 0))

    def take_troubles(self) -> list[str]:
        """What went wrong since the last call, in words."""
        return [self._troubles.popleft() for _ in range(len(self._troubles))]

    def end(self) -> None:
        """Do what was asked and end."""
        with self._changed:
            self._is_ending = True
            self._changed.notify()
        self._thread.join()

    def _add(self, job: _Job) -> None:
        with self._changed:
            self._jobs.append(job)
            self._changed.notify()

    def _run(self) -> None:
        while (job := self._next()) is not None:
            if not job.segment.is_doubtful:
                self._sync(job)
            if job.act == "seal":
                self._name(job.segment)
            if job.act != "sync":
                job.segment.close()

    def _next(self) -> _Job | None:
        with self._changed:
            while not self._jobs and not self._is_ending:
                self._changed.wait()
            return self._jobs.popleft() if self._jobs else None

    def _sync(self, job: _Job) -> None:
        try:
            job.segment.sync()
        except OSError as error:
            job.segment.is_doubtful = True
            self.is_durable = False
            self._troubles.append(
                f"{job.segment.partial}: a sync failed, nothing is durable from here on: {error}"
            )
        if self.is_durable and job.mark:
            self.done_mark = job.mark

    def _name(self, segment: Segment) -> None:
        try:
            segment.take_name()
        except OSError as error:
            self._troubles.append(
                f"{segment.path} is whole, but keeps its name {segment.partial}: {error}"
            )
