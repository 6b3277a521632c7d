"""One recording from a source: run it into a recorder until it ends or is ended."""

import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from seamlog.contracts import Pace, Sink, Source, SourceResult
from seamlog.files import check_output, write_bytes

from .accounts import Status
from .pacing import DurationOver, Pacer
from .recorder import Recorder
from .storage import DEFAULT, Snapshot, Storage


@dataclass(frozen=True, slots=True)
class Run:
    """What a recording came to; `files` were written beside the session."""

    status: Status
    ending: str
    """`the source ended`, `interrupted` or `the duration is over`."""
    files: tuple[Path, ...]


def run_source(
    source: Source,
    path: Path,
    meta: Mapping[str, str],
    realtime: bool = False,
    duration_s: float | None = None,
    force: bool = False,
    storage: Storage = DEFAULT,
    snapshot: Snapshot | None = None,
) -> Run:
    """Record `source` into `path`.

    A source that fails leaves a finished session of what it had logged, or nothing if it had
    logged nothing, and its error passes through.
    """
    pace: Pace = "paced" if realtime else source.pace
    recorder = Recorder(
        path, meta, source.clock, pace, force=force, storage=storage, snapshot=snapshot
    )
    try:
        result, ending = _run(source, recorder, realtime, duration_s)
    except BaseException:
        status = recorder.close()
        if not any(row.accepted for row in status.channels):
            path.unlink(missing_ok=True)
        raise
    status = recorder.close()
    return Run(status, ending, _write_files(path, result.files, force))


def _run(
    source: Source, recorder: Recorder, realtime: bool, duration_s: float | None
) -> tuple[SourceResult, str]:
    is_simulated = source.pace == "simulated"
    sink: Sink = Pacer(recorder, realtime, duration_s) if is_simulated else recorder
    try:
        with _ended_by_signals(), _alarm(None if is_simulated else duration_s):
            return source.run(sink), "the source ended"
    except KeyboardInterrupt:
        return SourceResult(), "interrupted"
    except DurationOver:
        return SourceResult(), "the duration is over"


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Take what `timeout`, `kill` and a terminal that closes send as Ctrl-C, unless ignored."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.getsignal(number) or signal.SIG_DFL for number in numbers}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _alarm(duration_s: float | None) -> Iterator[None]:
    """Raise `DurationOver` in the block after `duration_s` of real time."""
    if duration_s is None:
        yield
        return
    before = signal.signal(signal.SIGALRM, _over)
    signal.setitimer(signal.ITIMER_REAL, duration_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _over(*_: Any) -> NoReturn:
    raise DurationOver


def _write_files(path: Path, files: Mapping[str, bytes], force: bool) -> tuple[Path, ...]:
    beside = {path.with_suffix("." + suffix): data for suffix, data in files.items()}
    for file in beside:
        check_output(file, force)
    for file, data in beside.items():
        write_bytes(file, data)
    return tuple(beside)
