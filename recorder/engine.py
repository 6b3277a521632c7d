"""The work of the recorder process: pump the rings, sync, keep accounts, finish the file."""

import shutil
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .accounts import Account, account_document
from .feeds import Feed
from .folder import Recording
from .intake import Intake
from .journal import Journal
from .mcap_writer import SessionFile, written_files
from .ring import DROPPED, DURABLE, ENDED, LAST_SYNC_NS, WRITTEN, Ring
from .snapshot import SnapshotBuffer
from .storage import SYNC_S
from .varying_feed import VaryingFeed

_STATUS_S = 1.0
_CLOCK_STEP_NS = 100_000_000
_RETRY_S = 0.1
_GRACE_S = 0.05
_SPACE_FOR_S = 120.0
"""The disk is nearly full when it has room for less than this at the present rate."""
_MOST_FINDINGS = 100
CLOSED = "closed"
"""The ending of a recording that its loop has closed."""
_LAST_TRIES_S = 2.0
"""How long writing is tried again after the loop has ended."""


@dataclass(frozen=True, slots=True)
class _Mark:
    """A sync that was asked for: log time, and how much of each ring was written by then."""

    number: int
    time_ns: int
    written: list[tuple[Ring, int]]


class Engine:
    """Owns the session file from the first byte to its name."""

    def __init__(
        self,
        recording: Recording,
        folder: Path,
        descriptor: int,
        say: Callable[[Mapping[str, str]], None] = lambda _: None,
    ) -> None:
        self._recording = recording
        self._folder = folder
        self._say = say
        self._findings: list[str] = []
        self._notes: deque[tuple[str, str]] = deque()
        self._marks: deque[_Mark] = deque()
        self._marked = 0
        self._feeds: list[Feed] = []
        self._file = SessionFile(recording, folder, descriptor, self._fault, self._mark)
        self._journal = Journal(self._file)
        self._snapshot = self._make_snapshot()
        self._intake = Intake(folder, self._file, self._snapshot)
        self._feeds = self._intake.feeds
        self._file.farewell = self._write_all_accounts
        self._sync_every_s = SYNC_S[recording.storage.sync]
        self._synced_s = self._status_s = time.monotonic()
        self._retry_s = 0.0
        self._failures = 0
        self._asked_size = 0
        self._step_ns = self._wall_step_ns()
        self._dropped: dict[int, int] = {}
        self._explained: set[int] = set()
        self._sizes: deque[tuple[float, int]] = deque(maxlen=30)
        self._has_warned = self._has_stopped = self._has_warned_of_memory = False

    def _make_snapshot(self) -> SnapshotBuffer | None:
        if self._recording.snapshot is None:
            return None

        def note(reason: str, time_ns: int) -> None:
            self._notes.append(("TRIGGER", f"snapshot: {reason} at {time_ns} ns"))

        return SnapshotBuffer(self._recording.snapshot, self._file, note)

    def step(self) -> bool:
        """Do what is due now; True if there is more to do at once."""
        now_s = time.monotonic()
        if now_s < self._retry_s:
            return False
        try:
            busy = self._step(now_s)
        except OSError as error:
            # What could not be written is still in the rings.
            self._note_failure(error)
            self._retry_s = now_s + _RETRY_S
            return False
        self._failures = 0
        return busy

    def finish(self, ending: str) -> dict[str, Any]:
        """Write what is left, the final accounts and the footer; the accounts as a document.

        What cannot be written stays in the rings, and the file keeps its `.part` name.
        """
        try:
            self._persist(lambda: self._drain(ending))
            self._persist(lambda: self._sign(ending))
            is_whole = True
        except OSError as error:
            is_whole = False
            self._find(f"not all could be written: {error}; the rest is in {self._folder}")
        for trouble in self._file.finish():
            self._find(trouble)
        self._note_sync()
        if is_whole:
            shutil.rmtree(self._folder, ignore_errors=True)
        return {
            "channels": [account_document(row) for row in self._accounts()],
            "findings": self._findings,
            "files": written_files(self._file),
        }

    def _step(self, now_s: float) -> bool:
        self._intake.take()
        busy = self._pump(now_s, flush=False)
        urgent = [feed for feed in self._feeds if _is_urgent(feed)]
        if urgent:
            self._pump(now_s, flush=True)
        if self._snapshot is not None:
            self._snapshot.step()
            self._warn_of_short_memory(self._snapshot)
        self._sync(now_s, at_once=bool(urgent))
        self._write_notes()
        self._note_gaps()
        if self._recording.anchor_ns is not None:
            self._watch_clock()
        if now_s - self._status_s >= _STATUS_S and self._recording.pace == "paced":
            self._status_s = now_s
            if self._snapshot is None or self._snapshot.is_open:
                self._write_status(self._accounts())
            self._watch_space(now_s)
        if self._file.is_over_budget and not self._has_stopped:
            self._stop()
        return busy

    def _pump(self, now_s: float, flush: bool) -> bool:
        more = [feed.pump(now_s, flush) for feed in self._feeds]
        if flush:
            for feed in self._feeds:
                _calm(feed)
        return any(more)

    def _sync(self, now_s: float, at_once: bool) -> None:
        """Ask for a sync if one is due, and take note of the one that is done."""
        due = at_once or now_s - self._synced_s >= self._sync_every_s
        if due and self._file.size != self._asked_size:
            self._synced_s, self._asked_size = now_s, self._file.size
            self._file.request_sync()
        for trouble in self._file.watch():
            self._fault(trouble)
        self._note_sync()

    def _mark(self) -> int:
        """Note what is written at the moment when a sync is asked for."""
        self._marked += 1
        if self._file.is_durable:
            written = [(feed.ring, int(feed.ring.words[WRITTEN])) for feed in self._feeds]
            self._marks.append(_Mark(self._marked, self._log_time_ns(), written))
        return self._marked

    def _note_sync(self) -> None:
        """What was written when a sync was asked for that is done now is durable."""
        while self._marks and self._marks[0].number <= self._file.done_mark:
            mark = self._marks.popleft()
            for ring, written in mark.written:
                ring.words[DURABLE], ring.words[LAST_SYNC_NS] = written, mark.time_ns

    def _fault(self, finding: str) -> None:
        """Something is wrong with the files: tell the loop now, the log when it can be written."""
        if self._find(finding):
            self._notes.append(("FAULT", finding))

    def _note_failure(self, error: OSError) -> None:
        """The file has told of the first failure in a row itself."""
        self._failures += 1
        if self._failures > 1:
            self._fault(f"writing fails and is tried again: {error}")

    def _write_notes(self) -> None:
        while self._notes:
            kind, detail = self._notes[0]
            self._journal.event(kind, detail, self._log_time_ns())
            self._notes.popleft()

    def _watch_space(self, now_s: float) -> None:
        """Warn once while there is still time to make room."""
        self._sizes.append((now_s, self._file.size))
        (first_s, first_bytes), free = self._sizes[0], self._file.free_bytes()
        rate = (self._file.size - first_bytes) / max(now_s - first_s, 1.0)
        if free < rate * _SPACE_FOR_S and not self._has_warned:
            self._has_warned = True
            left = f"{free / 2**20:.0f} MiB are free, enough for {free / rate:.0f} s"
            self._say({"warning": f"the disk is nearly full: {left}"})
            self._notes.append(("NOTE", f"the disk is nearly full: {left}"))

    def _warn_of_short_memory(self, snapshot: SnapshotBuffer) -> None:
        if snapshot.is_short and not self._has_warned_of_memory:
            self._has_warned_of_memory = True
            self._say({"warning": "the memory of the snapshot is too small for all of its time"})

    def _stop(self) -> None:
        """The budget is used up: the loop is to take nothing more, what it has is written."""
        self._has_stopped = True
        budget = (self._recording.storage.budget_bytes or 0) / 2**20
        reason = f"the disk budget of {budget:.0f} MiB is used up, the recording has stopped"
        self._fault(reason)
        self._say({"stop": reason})

    def _note_gaps(self) -> None:
        """Accounts at the start of each run of drops, and the first reason of a channel."""
        rows = []
        for feed in self._feeds:
            dropped = int(feed.ring.words[DROPPED])
            if dropped > self._dropped.get(feed.channel_id, 0):
                rows.append(feed.account())
            self._dropped[feed.channel_id] = dropped
            self._explain(feed)
        if rows:
            self._write_status(rows)

    def _write_all_accounts(self) -> None:
        if rows := self._accounts():
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
        newest = (feed.gaps.newest_ns or 0 for feed in self._feeds)
        return max(newest, default=0) or self._recording.start_ns

    def _accounts(self) -> list[Account]:
        return [replace(feed.account(), longest_gap_s=feed.gaps.longest_s) for feed in self._feeds]

    def _write_status(self, rows: list[Account]) -> None:
        if self._recording.pace == "simulated":
            # Same seed, same messages: how full a ring was and when was synced is not of the seed.
            rows = [replace(row, ring_high_water=0.0, last_sync_ns=0, durable=0) for row in rows]
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
                self._note_failure(error)
                if time.monotonic() > deadline_s:
                    raise
                time.sleep(_RETRY_S)

    def _drain(self, ending: str) -> None:
        self._intake.take()
        for feed in self._feeds:
            feed.ring.words[ENDED] = 1
        if self._intake.has_joined:
            # A put of another process may be between its look at ENDED and its last store.
            time.sleep(_GRACE_S)
        if self._snapshot is not None and ending != CLOSED:
            self._snapshot.trigger(ending, self._log_time_ns())
        self._pump(time.monotonic(), flush=True)
        if self._snapshot is not None:
            self._snapshot.step()
            self._snapshot.end()

    def _sign(self, ending: str) -> None:
        """The last words of the recorder: why it ended; the file adds the accounts."""
        self._note_gaps()
        self._write_notes()
        self._file.add_metadata("seamlog.recording.end", {"ending": ending})

    def _find(self, finding: str) -> bool:
        """Keep a finding and tell it; False if it is known already."""
        if finding in self._findings or len(self._findings) >= _MOST_FINDINGS:
            return False
        self._findings.append(finding)
        self._say({"finding": finding})
        return True


def _is_urgent(feed: Feed) -> bool:
    return isinstance(feed, VaryingFeed) and feed.urgent


def _calm(feed: Feed) -> None:
    if isinstance(feed, VaryingFeed):
        feed.urgent = False
