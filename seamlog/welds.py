"""Welds of a session: from arc on to arc off, as `/events` tells them."""

from collections.abc import Sequence
from dataclasses import dataclass

from seamlog.channels import ARC_OFF, ARC_ON


@dataclass(frozen=True, slots=True)
class Weld:
    """One weld, counted from 1; log times, half-open `[start_ns, end_ns)`."""

    number: int
    start_ns: int
    end_ns: int

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return (self.end_ns - self.start_ns) / 1e9


def welds_of(
    kinds: Sequence[int], times_ns: Sequence[int], end_ns: int
) -> tuple[list[Weld], list[str]]:
    """Welds and what is odd about them, from event kinds in order of log time.

    A weld whose arc never went off ends behind `end_ns`, the last message of the session.
    """
    welds: list[Weld] = []
    oddities: list[str] = []
    start: int | None = None
    for kind, time in zip(kinds, times_ns, strict=True):
        if kind == ARC_ON and start is None:
            start = time
        elif kind == ARC_ON:
            oddities.append(f"ARC_ON at {time} ns while the arc was on")
        elif kind == ARC_OFF and start is not None:
            welds.append(Weld(len(welds) + 1, start, time))
            start = None
        elif kind == ARC_OFF:
            oddities.append(f"ARC_OFF at {time} ns while the arc was off")
    if start is not None:
        welds.append(Weld(len(welds) + 1, start, max(end_ns, start) + 1))
        oddities.append(f"weld {len(welds)} has no ARC_OFF; it is taken to last to the end")
    return welds, oddities
