"""How a recording is kept on the disk: how often it is synced, when a file ends, how much stays."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from seamlog.channels import EVENT_KINDS
from seamlog.errors import UsageError

SyncPolicy: TypeAlias = Literal["eco", "default", "strict"]
OverBudget: TypeAlias = Literal["oldest", "stop"]

SYNC_S: dict[SyncPolicy, float] = {"eco": 5.0, "default": 0.25, "strict": 0.1}
"""Longest time between a written chunk and the sync that follows it."""
_LEAST_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Storage:
    """Rules for the files of a recording; sizes in bytes, `UsageError` where they make no sense.

    A file (segment) ends at `segment_bytes` or `segment_s`, whatever comes first, and the next
    begins. `budget_bytes` bounds all files of the recording together: then the oldest ones are
    removed, or the recording stops.
    """

    sync: SyncPolicy = "default"
    segment_bytes: int = 256 << 20
    segment_s: float = 600.0
    budget_bytes: int | None = None
    over_budget: OverBudget = "stop"

    def __post_init__(self) -> None:
        if self.sync not in SYNC_S:
            raise UsageError(f"sync {self.sync!r} is none of {', '.join(SYNC_S)}")
        if self.over_budget not in ("oldest", "stop"):
            raise UsageError(f"over budget: {self.over_budget!r} is neither oldest nor stop")
        if self.segment_bytes < _LEAST_BYTES or not self.segment_s > 0:
            raise UsageError("a segment has at least 1 MiB and lasts longer than 0 s")
        if self.budget_bytes is not None and self.budget_bytes < 4 * _LEAST_BYTES:
            raise UsageError("the disk budget must be at least 4 MiB")

    @property
    def largest_segment_bytes(self) -> int:
        """Where a file ends: a quarter of the budget, so that there is something to remove."""
        most = self.segment_bytes
        return most if self.budget_bytes is None else min(most, self.budget_bytes // 4)


DEFAULT = Storage()


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Keep the last `before_s` in memory and write them, and `after_s` more, on a trigger.

    Triggers are `/events` of the kinds `events`, `Recorder.trigger`, `rules` such as
    "abs(error) > 1 mm" (see `trigger_rule`) and the death of the loop. `memory_bytes` bounds what
    is kept. `UsageError` for values that make no sense.
    """

    before_s: float = 10.0
    after_s: float = 5.0
    events: tuple[str, ...] = ("FAULT", "EMERGENCY_STOP", "TRIGGER")
    rules: tuple[str, ...] = ()
    memory_bytes: int = 512 << 20

    def __post_init__(self) -> None:
        if not (0 < self.before_s < 86_400 and 0 <= self.after_s < 86_400):
            raise UsageError("a snapshot keeps some time before its trigger, less than a day")
        if unknown := sorted(set(self.events) - set(EVENT_KINDS)):
            raise UsageError(f"snapshot: {', '.join(unknown)} is none of {', '.join(EVENT_KINDS)}")
        if self.memory_bytes < _LEAST_BYTES:
            raise UsageError("a snapshot needs at least 1 MiB of memory")
