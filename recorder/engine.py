"""The work of the recorder process: pump the rings, sync, keep accounts, finish the file."""

import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from .accounts import Account, account_document
from .feeds import Feed
from .folder import Recording
from .intake import Intake
from .journal import Journal
from .mcap_writer import SessionFile
from .ring import DROPPED, LAST_SYNC_NS
from .syncing import Syncer
from .varying_feed import VaryingFeed

_SYNC_S = 0.25
_STATUS_S = 1.0
_CLOCK_STEP_NS = 100_000_000
_RETRY_S = 0.1
_LAST_TRIES_S = 2.0
"""How long writing is tried again after the loop has ended."""


class Engine:
    """Owns the session file from the first byte to its name."""

    def __init__(self, recording: Recording, folder: Path, descriptor: int) -> None:
        self._recording = recording
        self._folder = folder
        self._file = SessionFile(recording, folder, descriptor)
        self._journal = Journal(self._file)
        self._intake = Intake(folder, self._file)
        self._synced_s = self._status_s = time.monotonic()
        self._retry_s = 0.0
        self._asked_size = 0
        self._syncer = Syncer(self._file.descriptor)
        self._is_durable = True
        self._last_sync_ns = 0
        self._step_ns = self._wall_step_ns()
        self._dropped: dict[int, int] = {}
        self._explained: set[int] = set()
        self._findings: list[str] = []

    def step(self) -> bool:
        """Do what is due now; True if there is more to do at once."""
        now_s = time.monotonic()
        if now_s < self._retry_s:
            return False
        try:
            return self._step(now_s)
        except OSError as error:
            self._find(f"writing failed and is tried again: {error}")
            self._retry_s = now_s + _RETRY_S
            return False

    def finish(self, ending: str) -> dict[str, Any]:
        """Write what is left, the final accounts and the footer; the accounts as a document.

        What cannot be written stays in the rings, and the file keeps its `.part` name.
        """
        try:
            self._persist(self._drain)
            self._syncer.end()
            self._sync_all()
            self._persist(lambda: self._sign(ending))
            self._persist(self._file.finish)
            self._sync_all()
            self._take_name()
            shutil.rmtree(self._folder, ignore_errors=True)
        except OSError as error:
            where = f"{self._recording.partial} is unfinished; the rest is in {self._folder}"
            self._find(f"the file could not be finished: {error}; {where}")
        self._file.close()
        return {
            "channels": [account_document(row) for row in self._accounts()],
            "findings": self._findings,
        }

    def _step(self, now_s: float) -> bool:
        self._intake.take()
        busy = self._pump(now_s, flush=False)
        urgent = [feed for feed in self._intake.feeds if _is_urgent(feed)]
        if urgent:
            self._pump(now_s, flush=True)
        self._sync(now_s, at_once=bool(urgent))
        self._note_gaps()
        if self._recording.anchor_ns is not None:
            self._watch_clock()
        if now_s - self._status_s >= _STATUS_S and self._recording.pace == "paced":
            self._status_s = now_s
            self._write_status(self._accounts())
        return busy

    def _pump(self, now_s: float, flush: bool) -> bool:
        more = [feed.pump(now_s, flush) for feed in self._intake.feeds]
        if flush:
            for feed in self._intake.feeds:
                _calm(feed)
        return any(more)

    def _sync(self, now_s: float, at_once: bool) -> None:
        """Ask for a sync if one is due, and take note of the one that is done."""
        due = at_once or now_s - self._synced_s >= _SYNC_S
        if due and self._file.size != self._asked_size and self._is_durable:
            self._synced_s, self._asked_size = now_s, self._file.size
            self._syncer.request(self._log_time_ns())
        if self._syncer.error and self._is_durable:
            self._is_durable = False
            self._find(f"a sync failed, nothing is durable from here on: {self._syncer.error}")
            self._journal.event("FAULT", self._findings[-1], self._log_time_ns())
        self._note_sync(self._syncer.done_mark)

    def _note_sync(self, time_ns: int) -> None:
        if time_ns > self._last_sync_ns:
            self._last_sync_ns = time_ns
            for feed in self._intake.feeds:
                feed.ring.words[LAST_SYNC_NS] = time_ns

    def _note_gaps(self) -> None:
        """Accounts at the start of each run of drops, and the first reason of a channel."""
        rows = []
        for feed in self._intake.feeds:
            dropped = int(feed.ring.words[DROPPED])
            if dropped > self._dropped.get(feed.channel_id, 0):
                rows.append(feed.account())
            self._dropped[feed.channel_id] = dropped
            self._explain(feed)
        if rows:
            self._write_status(rows)

    def _explain(self, feed: Feed) -> None:
        reason = feed.ring.reason
        if reason and feed.channel_id not in self._explained:
            self._journal.event("NOTE", f"{feed.topic}: {reason}", self._log_time_ns())
            self._explained.add(feed.channel_id)

    def _watch_clock(self) -> None:
        step = self._wall_step_ns()
        if abs(step - self._step_ns) > _CLOCK_STEP_NS:
            moved = (step - self._step_ns) / 1e9
            self._step_ns = step
            detail = f"the wall clock moved by {moved:+.3f} s; log time did not"
            self._journal.event("CLOCK_STEP", detail, self._log_time_ns())

    def _wall_step_ns(self) -> int:
        return time.time_ns() - time.monotonic_ns() - (self._recording.anchor_ns or 0)

    def _log_time_ns(self) -> int:
        """Log time now; where the clock is not ours to read, that of the newest message."""
        if self._recording.anchor_ns is not None:
            return time.monotonic_ns() + self._recording.anchor_ns
        newest = (feed.gaps.newest_ns or 0 for feed in self._intake.feeds)
        return max(newest, default=0) or self._recording.start_ns

    def _accounts(self) -> list[Account]:
        return [
            replace(feed.account(), longest_gap_s=feed.gaps.longest_s)
            for feed in self._intake.feeds
        ]

    def _write_status(self, rows: list[Account]) -> None:
        if self._recording.pace == "simulated":
            # How full a ring was is the machine's doing; same seed, same messages.
            rows = [replace(row, ring_high_water=0.0) for row in rows]
            self._journal.status(rows, 0, self._log_time_ns())
        else:
            self._journal.status(rows, self._file.free_bytes(), self._log_time_ns())

    def _persist(self, act: Callable[[], None]) -> None:
        """Do `act`, which has no effect when it fails, again for a while until it succeeds."""
        deadline_s = time.monotonic() + _LAST_TRIES_S
        while True:
            try:
                return act()
            except OSError as error:
                if time.monotonic() > deadline_s:
                    raise
                self._find(f"writing failed and is tried again: {error}")
                time.sleep(_RETRY_S)

    def _sync_all(self) -> None:
        """Sync and wait for it."""
        if not self._is_durable:
            return
        try:
            self._file.sync()
            self._note_sync(self._log_time_ns())
        except OSError as error:
            self._is_durable = False
            self._find(f"the last sync failed, the file may not survive a loss of power: {error}")

    def _drain(self) -> None:
        self._intake.take()
        self._pump(time.monotonic(), flush=True)

    def _sign(self, ending: str) -> None:
        """The last words of the recorder: accounts and why it ended."""
        self._note_gaps()
        rows = self._accounts()
        if rows:
            self._write_status(rows)
        self._file.add_metadata("seamlog.recording.end", {"ending": ending})

    def _take_name(self) -> None:
        try:
            self._file.take_name()
        except OSError as error:
            partial = self._recording.partial
            self._find(f"the session is whole, but keeps its name {partial}: {error}")

    def _find(self, finding: str) -> None:
        if finding not in self._findings:
            self._findings.append(finding)


def _is_urgent(feed: Feed) -> bool:
    return isinstance(feed, VaryingFeed) and feed.urgent


def _calm(feed: Feed) -> None:
    if isinstance(feed, VaryingFeed):
        feed.urgent = False
