"""The recorder as the live loop sees it."""

import logging
import os
import sys
import threading
import time
import uuid
import weakref
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from threading import get_ident
from types import TracebackType
from typing import Any, Self

from numpy.typing import NDArray

from seamlog.clock import Clock, MonotonicClock
from seamlog.contracts import Pace
from seamlog.errors import RecordingError, SeamlogError, UsageError
from seamlog.limits import LIMITS

from .accounts import Status, read_account, ring_account
from .channel import Channel, known_row, make_channel, producer_name
from .folder import RESERVED, OutTray, Recording, abandoned_folders, make_folder, read_recording
from .gate import Gate
from .launch import WritingProcess, claim_partial
from .put_source import Put
from .ring import TAKEN_IN, Ring
from .storage import DEFAULT, Snapshot, Storage, SyncPolicy
from .trigger_rule import parse_rule

_log = logging.getLogger("seamlog.recorder")
_INTAKE_S = 2.0
_living: "weakref.WeakSet[Recorder]" = weakref.WeakSet()


class Recorder:
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
        self.clock: Clock = clock or MonotonicClock()
        self.strict = strict
        self._recording = _describe(
            Path(path), meta or {}, self.clock, pace, force, storage, snapshot
        )
        self._channels: dict[tuple[str, int], Channel] = {}
        self._heard: list[str] = []
        _warn_of_abandoned()
        descriptor = claim_partial(self._recording)
        try:
            folder, lock = make_folder(self._recording)
            self._process = WritingProcess(folder, descriptor, lock, self._hear)
        except BaseException:
            self._recording.partial.unlink(missing_ok=True)
            os.close(descriptor)
            raise
        self._tray = OutTray(folder)
        self._mine = threading.local()
        self._strangers: dict[str, str] = {}
        self._final: Status | None = None
        _living.add(self)

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

    def channel(self, topic: str, metadata: Mapping[str, str] | None = None) -> Channel:
        """The channel of `topic` for this thread, made when first asked for.

        Making it allocates its ring (milliseconds): ask before the loop begins. `UsageError` for
        an unknown topic, a closed recorder or other metadata than before; `SpaceMissing` if
        there is too little shared memory.
        """
        key = (topic, get_ident())
        found = self._channels.get(key)
        if found is None:
            return self._make_channel(key, metadata or {})
        extra = {k: v for k, v in (metadata or {}).items() if found.metadata.get(k) != v}
        if extra:
            raise UsageError(f"{topic} is being recorded already, without {extra}")
        return found

    def log(self, topic: str, stamp_ns: int | None = None, **fields: Any) -> bool:
        """Log one message by field names; False if it was not accepted."""
        try:
            put: Put = self._mine.puts[topic]
        except (AttributeError, KeyError):
            put = self._late_put(topic)
        if stamp_ns is None:
            stamp_ns = self.clock.now_ns()
        try:
            return put(stamp_ns, **fields)
        except TypeError:
            return self._channels[topic, get_ident()].refuse_names(fields)

    def log_frame(self, topic: str, image: NDArray[Any], stamp_ns: int | None = None) -> bool:
        """Log a picture, uint8, shape (rows, columns) grey or (rows, columns, 3) BGR.

        The loop pays one copy; the recorder process makes a JPEG of it.
        """
        channel = self._channels.get((topic, get_ident())) or self._late_channel(topic)
        if channel is None:
            return self._turn_away(topic)
        return channel.put_frame(self.clock.now_ns() if stamp_ns is None else stamp_ns, image)

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Put a file into the session, at most `LIMITS.attachment_bytes`.

        It goes through shared memory: `SpaceMissing` if there is too little.
        """
        if not name or len(data) > LIMITS.attachment_bytes:
            most = f"{LIMITS.attachment_bytes >> 20} MiB"
            raise UsageError(f"an attachment needs a name and at most {most}: {name!r}")
        with self._tray.lock:
            self._check_open()
            file = self._tray.place_data(data)
            item = {"kind": "attachment", "name": name, "media_type": media_type}
            self._tray.place(item | {"data": file, "log_time_ns": self.clock.now_ns()})

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Put a metadata record into the session."""
        checked = {str(key): str(value) for key, value in values.items()}
        self._check_open()
        self._tray.place({"kind": "metadata", "name": name, "values": checked})

    def trigger(self, reason: str) -> None:
        """Snapshot mode: write what is kept, and what follows. Costs a file in shared memory."""
        if self._recording.snapshot is None:
            raise UsageError("trigger() is for snapshot mode: Recorder(..., snapshot=Snapshot())")
        self._check_open()
        item = {"kind": "trigger", "reason": reason, "log_time_ns": self.clock.now_ns()}
        self._tray.place(item)

    def status(self) -> Status:
        """The accounts so far, and what went wrong; the final ones after `close`."""
        if self._final:
            return self._final
        alive = self._process.is_alive()
        findings = self._findings() if alive else (*self._findings(), self._lost_process())
        rows = tuple(
            ring_account(row.topic, row.metadata["producer"], row.gate.ring, row.gate.ring.accepted)
            for row in list(self._channels.values())
        )
        return Status(self.id, str(self.path), alive, rows, findings, sync=self._sync)

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

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _make_channel(self, key: tuple[str, int], metadata: Mapping[str, str]) -> Channel:
        known_row(key[0])
        named = {str(k): str(v) for k, v in metadata.items()} | {"producer": producer_name()}
        with self._tray.lock:
            self._check_open()
            number = len(self._channels)
            made = make_channel(key[0], named, self._tray, self.clock, self._gate, number)
            self._channels[key] = made
        self._await_intake(made.gate.ring)
        return made

    def _await_intake(self, ring: Ring) -> None:
        """Until the recorder process watches the ring: from then on chunks close in time."""
        deadline_s = time.monotonic() + _INTAKE_S
        while not ring.words[TAKEN_IN] and time.monotonic() < deadline_s:
            if not self._process.is_alive():
                return
            time.sleep(0.001)

    def _gate(self, topic: str, ring: Ring) -> Gate:
        waits = self._recording.pace == "simulated"
        return Gate(topic, ring, waits, self.strict, self._process.is_alive)

    def _late_put(self, topic: str) -> Put:
        channel = self._late_channel(topic)
        if channel is None:
            return lambda *_, **__: self._turn_away(topic)
        self._mine.__dict__.setdefault("puts", {})[topic] = channel.put_named
        return channel.put_named

    def _late_channel(self, topic: str) -> Channel | None:
        try:
            return self.channel(topic)
        except (SeamlogError, OSError) as error:
            self._strangers.setdefault(topic, str(error))
            return None

    def _turn_away(self, topic: str) -> bool:
        if self.strict:
            raise RecordingError(f"{topic}: message not recorded: {self._strangers[topic]}")
        return False

    def _check_open(self) -> None:
        if self._final is not None:
            raise UsageError(f"the recording of {self.path} is closed")

    def _stop_channels(self) -> None:
        mine = get_ident()
        channels = list(self._channels.values())
        _stop(channels)
        if any(channel.gate.owner != mine for channel in channels):
            # A put of another thread may be between its check and its last store.
            time.sleep(2 * sys.getswitchinterval())
            _stop(channels)

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
        _stop(list(self._channels.values()))
        self._process.leave()


def _stop(channels: list[Channel]) -> None:
    for channel in channels:
        channel.gate.is_open = False
        channel.stop()


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
        _log.warning("%s died unfinished; messages that it had accepted are in %s", partial, folder)


def _leave_all() -> None:
    for recorder in list(_living):
        recorder._leave()


os.register_at_fork(after_in_child=_leave_all)
