"""Logging into a recording that another process has started."""

import os
import sys
from pathlib import Path
from typing import Any

from seamlog.clock import MonotonicClock
from seamlog.errors import UsageError

from .channel import Channel, producer_name
from .folder import OutTray, Recording, is_locked, read_recording, root
from .producer import Producer
from .ring import ENDED, Ring


def join(path: str | Path, name: str = "", strict: bool = False) -> "JoinedProducer":
    """Take part in the recording of the session `path`, from another process.

    Channels are as those of a `Recorder`, each with a ring of its own; `name` says in their
    metadata who logs (else the program and its process id). The recording ends when the process
    that has started it closes it or dies: then `put` returns False. `UsageError` if nothing is
    recorded there, or with a simulated clock.
    """
    where = str(Path(path).absolute())
    for folder in root().iterdir():
        try:
            recording = read_recording(folder)
            is_it = recording.path == where and is_locked(folder)
        except (OSError, ValueError, TypeError, KeyError, UsageError):
            continue
        if is_it and recording.anchor_ns is None:
            raise UsageError(f"{path} is recorded by a clock of its own and cannot be joined")
        if is_it:
            return JoinedProducer(recording, folder, name, strict)
    raise UsageError(f"{path} is not being recorded; start the recording first")


class JoinedProducer(Producer):
    """A process that logs into a recording of another one; a context manager."""

    def __init__(self, recording: Recording, folder: Path, name: str, strict: bool) -> None:
        clock = MonotonicClock()
        assert recording.anchor_ns is not None
        clock.anchor_ns = recording.anchor_ns
        super().__init__(recording, OutTray(folder), clock, strict)
        self._name = name or f"{Path(sys.argv[0]).name or 'python'}-{os.getpid()}"
        self._is_closed = False

    def close(self) -> None:
        """Take nothing more; what was accepted is written by the recorder process."""
        self._is_closed = True
        self._stop_channels()

    def _is_alive(self) -> bool:
        try:
            return is_locked(self._tray.folder)
        except OSError:
            return False

    def _check_open(self) -> None:
        if self._is_closed or not (self._tray.folder / "recording.json").exists():
            raise UsageError(f"the recording of {self._recording.path} is closed")

    def _metadata(self) -> dict[str, str]:
        thread = producer_name()
        name = self._name if thread == "main" else f"{self._name}/{thread}"
        return {"producer": name, "producer_pid": str(os.getpid())}

    def _fitted(self, channel: Channel) -> Channel:
        return _ending(channel)


def _ending(channel: Channel) -> Channel:
    """`channel` that looks before each message whether the recording has ended."""
    ring: Ring = channel.gate.ring

    def until_ended(put: Any) -> Any:
        words, gate = ring.words, channel.gate

        def put_or_refuse(*values: Any, **fields: Any) -> bool:
            if words[ENDED]:
                gate.is_open = False
                return gate.refuse_closed()
            return bool(put(*values, **fields))

        return put_or_refuse

    return Channel(
        channel.topic,
        channel.metadata,
        until_ended(channel.put),
        until_ended(channel.put_named),
        until_ended(channel.put_frame),
        channel.loan_frame,
        channel.stop,
        channel.gate,
    )
