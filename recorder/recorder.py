"""The recorder as the live loop sees it."""

import logging
import os
import uuid
import weakref
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from seamlog.clock import Clock, MonotonicClock
from seamlog.contracts import Pace
from seamlog.errors import UsageError

from .accounts import Status, read_account
from .folder import RESERVED, OutTray, Recording, abandoned_folders, make_folder, read_recording
from .launch import WritingProcess, claim_partial
from .producer import Producer, stop
from .storage import DEFAULT, Snapshot, Storage, SyncPolicy
from .trigger_rule import parse_rule

_log = logging.getLogger("seamlog.recorder")
_living: "weakref.WeakSet[Recorder]" = weakref.WeakSet()


class Recorder(Producer):
    """Records one session; a context manager.

    `path` is the session file to be; `meta` goes into its metadata. `clock` gives the log times.
    `pace` "paced": a full ring drops the new message; "simulated": `put` waits for room.
    `strict` makes `put` and `log` raise `RecordingError` instead of returning False. `force`
    replaces an existing file. `storage` says how often is synced, where files end, how much disk
    may be used. With `snapshot` only what is around a trigger is written.

    Raises `OutputExists`, `InputError` (no such folder), `HardwareError`. Afterwards neither
    `put` nor `log` nor `log_frame` raises: they return False and count.
    """

    def __init__(
        self,
        path: str | Path,
        meta: Mapping[str, str] | None = None,
        clock: Clock | None = None,
        pace: Pace = "paced",
        strict: bool = False,
        force: bool = False,
        storage: Storage = DEFAULT,
        snapshot: Snapshot | None = None,
    ) -> None:
        clock = clock or MonotonicClock()
        recording = _describe(Path(path), meta or {}, clock, pace, force, storage, snapshot)
        self._heard: list[str] = []
        self._final: Status | None = None
        _warn_of_abandoned()
        descriptor = claim_partial(recording)
        try:
            folder, lock = make_folder(recording)
            super().__init__(recording, OutTray(folder), clock, strict)
            self._process = WritingProcess(folder, descriptor, lock, self._hear)
        except BaseException:
            recording.partial.unlink(missing_ok=True)
            os.close(descriptor)
            raise
        _living.add(self)
        try:
            self._process.await_ready()
        except BaseException:
            self.close()
            self.path.unlink(missing_ok=True)
            raise

    @property
    def id(self) -> str:
        """Id of the recording, in the metadata record `seamlog.recording`."""
        return self._recording.id

    @property
    def _sync(self) -> SyncPolicy:
        return self._recording.storage.sync

    @property
    def path(self) -> Path:
        """The session file, there once the recording is closed."""
        return Path(self._recording.path)

    @property
    def recorder_pid(self) -> int:
        """Process id of the recorder process."""
        return self._process.pid

    def status(self) -> Status:
        """The accounts so far, and what went wrong; the final ones after `close`."""
        if self._final:
            return self._final
        alive = self._process.is_alive()
        findings = self._findings() if alive else (*self._findings(), self._lost_process())
        return Status(self.id, str(self.path), alive, self.accounts(), findings, sync=self._sync)

    def close(self) -> Status:
        """End the recording: all that was accepted is in the file, the file has its name.

        Never hangs: if the recorder process is lost or stuck, the findings say so.
        """
        if self._final is None:
            self._stop_channels()
            document = self._process.finish(self.path)
            self._final = self._conclude(document)
            _living.discard(self)
            _tell(self._final, self._heard)
        return self._final

    def _is_alive(self) -> bool:
        return self._process.is_alive()

    def _check_open(self) -> None:
        if self._final is not None:
            raise UsageError(f"the recording of {self.path} is closed")

    def _findings(self) -> tuple[str, ...]:
        strangers = (f"{topic}: {why}" for topic, why in self._strangers.items())
        return (*strangers, *self._heard)

    def _hear(self, said: Mapping[str, str]) -> None:
        """What the recorder process says while it works; called in a thread of its own."""
        for kind, text in said.items():
            _log.warning("%s: %s", self.path, text)
            if kind == "finding":
                self._heard.append(text)
            elif kind == "stop":
                for channel in list(self._channels.values()):
                    channel.gate.ending = text
                    channel.gate.is_open = False
                    channel.stop()

    def _lost_process(self) -> str:
        words = self._process.last_words()
        return (
            f"the recorder process was lost{f' ({words})' if words else ''}: what it had written "
            f"is in {self._recording.partial}, what was accepted and not written yet is in "
            f"{self._tray.folder}"
        )

    def _conclude(self, document: dict[str, Any] | None) -> Status:
        if document is None:
            status = self.status()
            stuck = "the recorder process is still finishing the file"
            findings = (*status.findings, stuck) if status.is_recording else status.findings
            return replace(status, is_recording=False, findings=findings)
        rows = tuple(read_account(row) for row in document["channels"])
        findings = tuple(dict.fromkeys((*self._findings(), *document["findings"])))
        return Status(
            self.id, str(self.path), False, rows, findings, tuple(document["files"]), self._sync
        )

    def _leave(self) -> None:
        """In a forked child: take no part in the recording."""
        self._final = Status(self.id, str(self.path), False, (), ("forked",))
        stop(list(self._channels.values()))
        self._process.leave()


def _describe(
    path: Path,
    meta: Mapping[str, str],
    clock: Clock,
    pace: Pace,
    force: bool,
    storage: Storage,
    snapshot: Snapshot | None,
) -> Recording:
    anchor = clock.anchor_ns if isinstance(clock, MonotonicClock) else None
    named = {str(key): str(value) for key, value in meta.items()}
    if taken := sorted(set(named) & set(RESERVED)):
        raise UsageError(f"metadata {', '.join(taken)}: the recorder writes these itself")
    for rule in snapshot.rules if snapshot else ():
        parse_rule(rule)
    start, where = clock.now_ns(), str(path.absolute())
    return Recording(
        uuid.uuid4().hex, where, start, pace, anchor, force, os.getpid(), named, storage, snapshot
    )


def _tell(status: Status, heard: Collection[str]) -> None:
    for finding in status.findings:
        if finding not in heard:
            _log.warning("%s: %s", status.path, finding)
    for row in status.channels:
        if row.dropped or row.refused or row.lost:
            counts = f"{row.dropped} dropped, {row.refused} refused, {row.lost} lost"
            _log.warning("%s: %s: %s; first: %s", status.path, row.topic, counts, row.reason)


def _warn_of_abandoned() -> None:
    for folder in abandoned_folders():
        partial = read_recording(folder).partial
        _log.warning(
            "%s died unfinished; 'seamlog recover' takes what it had accepted from %s",
            partial,
            folder,
        )


def _leave_all() -> None:
    for recorder in list(_living):
        recorder._leave()


os.register_at_fork(after_in_child=_leave_all)
