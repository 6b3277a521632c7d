"""What logs into a recording: a loop, or one of several; each thread has channels of its own."""

import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from threading import get_ident
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from seamlog.clock import Clock
from seamlog.errors import RecordingError, SeamlogError, UsageError
from seamlog.limits import LIMITS

from .accounts import Account, ring_account
from .channel import Channel, known_row, make_channel, producer_name
from .folder import OutTray, Recording
from .gate import Gate
from .ring import TAKEN_IN, Ring

_INTAKE_S = 2.0


class _Own(threading.local):
    """The channels of each thread, by topic."""

    def __init__(self) -> None:
        self.channels: dict[str, Channel] = {}


class Producer(ABC):
    """The part of a recorder that every process that logs has."""

    def __init__(self, recording: Recording, tray: OutTray, clock: Clock, strict: bool) -> None:
        self.clock = clock
        self.strict = strict
        self._recording = recording
        self._tray = tray
        self._channels: dict[tuple[str, int], Channel] = {}
        self._mine = _Own()
        self._strangers: dict[str, str] = {}

    def channel(self, topic: str, metadata: Mapping[str, str] | None = None) -> Channel:
        """The channel of `topic` for this thread, made when first asked for.

        Making it allocates its ring, milliseconds, for pictures tenths of a second: ask before
        the loop begins. `UsageError` for an unknown topic, a closed recorder or other metadata
        than before; `SpaceMissing` if there is too little shared memory.
        """
        key = (topic, get_ident())
        found = self._channels.get(key)
        if found is None:
            return self._make_channel(key, metadata or {})
        extra = {k: v for k, v in (metadata or {}).items() if found.metadata.get(k) != v}
        if extra:
            raise UsageError(f"{topic} is being recorded already, without {extra}")
        self._mine.channels[topic] = found
        return found

    def log(self, topic: str, stamp_ns: int | None = None, **fields: Any) -> bool:
        """Log one message by field names; False if it was not accepted."""
        channel = self._mine.channels.get(topic) or self._late_channel(topic)
        if channel is None:
            return self._turn_away(topic)
        if stamp_ns is None:
            stamp_ns = self.clock.now_ns()
        try:
            return channel.put_named(stamp_ns, fields)
        except TypeError:
            return channel.refuse_names(fields)

    def log_frame(self, topic: str, image: NDArray[Any], stamp_ns: int | None = None) -> bool:
        """Log a picture, uint8, shape (rows, columns) grey or (rows, columns, 3) BGR.

        The loop pays one copy, none of a picture read into `loan_frame`; the recorder process
        makes a JPEG of it.
        """
        channel = self._mine.channels.get(topic) or self._late_channel(topic)
        if channel is None:
            return self._turn_away(topic)
        return channel.put_frame(self.clock.now_ns() if stamp_ns is None else stamp_ns, image)

    def loan_frame(self, topic: str, shape: tuple[int, ...]) -> NDArray[np.uint8]:
        """A picture for the camera to read into and `log_frame` to log, in the recorder's memory.

        Lent until something is logged on this channel, one at a time; what was logged may be
        read for a while and not written again. Other memory, which `log_frame` copies, where the
        ring has no room. `ValueError` if `shape` is none that a picture may have.
        """
        channel = self._mine.channels.get(topic) or self._late_channel(topic)
        return np.empty(shape, np.uint8) if channel is None else channel.loan_frame(shape)

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Put a file into the session, at most `LIMITS.attachment_bytes`.

        It goes through shared memory: `SpaceMissing` if there is too little.
        """
        if not name or len(data) > LIMITS.attachment_bytes:
            most = f"{LIMITS.attachment_bytes >> 20} MiB"
            raise UsageError(f"an attachment needs a name and at most {most}: {name!r}")
        self._check_open()
        with self._tray.turn():
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

    def accounts(self) -> tuple[Account, ...]:
        """The accounts of this process' own channels so far."""
        return tuple(
            ring_account(row.topic, row.metadata["producer"], row.gate.ring, row.gate.ring.accepted)
            for row in list(self._channels.values())
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @abstractmethod
    def close(self) -> Any:
        """Take nothing more."""

    def _make_channel(self, key: tuple[str, int], metadata: Mapping[str, str]) -> Channel:
        known_row(key[0])
        named = {str(k): str(v) for k, v in metadata.items()} | self._metadata()
        self._check_open()
        with self._tray.turn() as number:
            self._check_open()
            bare = make_channel(key[0], named, self._tray, self.clock, self._gate, number)
            made = self._fitted(bare)
            self._channels[key] = made
            self._mine.channels[key[0]] = made
        self._await_intake(made.gate.ring)
        return made

    def _await_intake(self, ring: Ring) -> None:
        """Until the recorder process watches the ring: from then on chunks close in time."""
        deadline_s = time.monotonic() + _INTAKE_S
        while not ring.words[TAKEN_IN] and time.monotonic() < deadline_s:
            if not self._is_alive():
                return
            time.sleep(0.001)

    def _gate(self, topic: str, ring: Ring) -> Gate:
        waits = self._recording.pace == "simulated"
        return Gate(topic, ring, waits, self.strict, self._is_alive)

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

    def _stop_channels(self) -> None:
        mine = get_ident()
        channels = list(self._channels.values())
        stop(channels)
        if any(channel.gate.owner != mine for channel in channels):
            # A put of another thread may be between its check and its last store.
            time.sleep(2 * sys.getswitchinterval())
            stop(channels)

    @abstractmethod
    def _is_alive(self) -> bool:
        """The recorder process works."""

    @abstractmethod
    def _check_open(self) -> None:
        """`UsageError` once the recording is closed."""

    def _metadata(self) -> dict[str, str]:
        """Who logs, for the channel's metadata."""
        return {"producer": producer_name()}

    def _fitted(self, channel: Channel) -> Channel:
        """The channel as this producer uses it."""
        return channel


def stop(channels: list[Channel]) -> None:
    """Take nothing more."""
    for channel in channels:
        channel.gate.is_open = False
        channel.stop()
