"""The course of each channel through a session: sequences without gap, times that go forward."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.findings import Finding, Severity
from seamlog.mcap.records import ChannelRecord, ChunkEntry

if TYPE_CHECKING:
    from seamlog.mcap.examine import Examination

_SEQUENCES = 1 << 32
_STEP_NS = 500_000_000
"""A source clock that moves by so much against log time from one message to the next is said."""
_COUNTED = 0.5
"""Share of steps by one above which a channel's sequences are taken to count its messages."""


@dataclass(slots=True)
class Course:
    """One channel so far."""

    count: int = 0
    _tail: NDArray[Any] | None = field(default=None, repr=False)

    def joined(self, heads: NDArray[Any]) -> NDArray[Any]:
        """`heads` with the last one before them in front."""
        whole = heads if self._tail is None else np.concatenate([self._tail, heads])
        self._tail = heads[-1:].copy()
        self.count += len(heads)
        return whole

    def forget(self) -> None:
        """What comes next does not follow what was."""
        self._tail = None


class Courses:
    """All channels of a session by topic and producer."""

    def __init__(self) -> None:
        self.by_channel: dict[tuple[str, str], Course] = {}

    def begin_file(self) -> None:
        """Writers other than our recorder count anew in each file."""
        for key, course in self.by_channel.items():
            if not key[1]:
                course.forget()

    def take(
        self, frame: "Examination", channel: ChannelRecord, heads: NDArray[Any], entry: ChunkEntry
    ) -> Iterator[Finding]:
        """Take in the messages of one chunk, in order, and say what is odd about them."""
        key = (channel.topic, channel.metadata.get("producer", ""))
        course = self.by_channel.setdefault(key, Course())
        heads = course.joined(heads)
        if len(heads) < 2:
            return
        place = {"topic": channel.topic, "offset": entry.offset, "length": entry.length}
        yield from _sequence_gaps(frame, heads, place)
        yield from _source_steps(frame, heads, place)
        if key[1]:
            yield from _backwards(frame, heads, place)


def iter_missing(heads: NDArray[Any]) -> Iterator[tuple[int, int]]:
    """Where sequences go on by more than one: position in `heads` and messages that are missing.

    Negative where they go back. Nothing where they do not count the messages at all.
    """
    sequences: NDArray[np.int64] = heads["sequence"].astype(np.int64)
    steps = np.diff(sequences) % _SEQUENCES
    if len(steps) > 1 and (steps == 1).mean() < _COUNTED:
        return
    for at in np.flatnonzero(steps != 1).tolist():
        step = int(steps[at])
        if 1 < step < _SEQUENCES // 2:
            yield at, step - 1
        elif len(steps) > 1:
            yield at, -1


def _sequence_gaps(
    frame: "Examination", heads: NDArray[Any], place: dict[str, Any]
) -> Iterator[Finding]:
    for at, missing in iter_missing(heads):
        span = {"start_ns": int(heads["log_time"][at]), "end_ns": int(heads["log_time"][at + 1])}
        pair = f"{heads['sequence'][at]} to {heads['sequence'][at + 1]}"
        if missing > 0:
            cause = f"sequence {pair}: {missing} messages were dropped or lost here"
            action = "see the recorder's accounts; a faster disk or fewer topics avoid drops"
            yield frame.finding("sequence-gap", Severity.ERROR, cause, action, **place, **span)
        else:
            cause = f"sequence {pair}: messages are repeated or out of order"
            action = "two recordings may have been joined; look at the times"
            yield frame.finding("sequence-back", Severity.WARNING, cause, action, **place, **span)


def _source_steps(
    frame: "Examination", heads: NDArray[Any], place: dict[str, Any]
) -> Iterator[Finding]:
    """Where the clock of the source jumped against log time (publish time repeats the stamp)."""
    if not heads["publish_time"].all():
        return
    behind = heads["log_time"].astype(np.int64) - heads["publish_time"].astype(np.int64)
    moves = np.diff(behind)
    for at in np.flatnonzero(np.abs(moves) > _STEP_NS).tolist():
        time = int(heads["log_time"][at + 1])
        cause = f"the stamps moved by {-int(moves[at]) / 1e9:+.3f} s against log time here"
        action = "check the source's clock; joins by stamp are off across this place"
        yield frame.finding(
            "clock-step", Severity.WARNING, cause, action, **place, start_ns=time, end_ns=time
        )


def _backwards(
    frame: "Examination", heads: NDArray[Any], place: dict[str, Any]
) -> Iterator[Finding]:
    """Log times of one producer never go back: its clock is monotonic."""
    times = heads["log_time"].astype(np.int64)
    for at in np.flatnonzero(np.diff(times) < 0).tolist():
        back = (times[at] - times[at + 1]) / 1e9
        yield frame.finding(
            "log-time-back",
            Severity.WARNING,
            f"log time goes back by {back:.6f} s",
            "the writer's clock is not monotonic; columns are sorted by log time",
            **place,
            start_ns=int(times[at + 1]),
            end_ns=int(times[at]),
        )
