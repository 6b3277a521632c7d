"""Start, stop and gaps of a bead, from its width profile."""

from dataclasses import dataclass

import numpy as np

from seamlog.analysis.bead.measurement import END, BeadMeasurement
from seamlog.analysis.bead.part import gaps

NO_BEAD = "no bead seen"
_ROUND = 0.5
_LENGTH = 1.5
_UNUSUAL = 0.15


@dataclass(frozen=True, slots=True)
class BeadEnd:
    """The width near an end of the bead against that of the whole bead.

    `ratio` is None with the `reason` where the end is not in the photo or cannot be measured.
    """

    name: str
    s: float
    ratio: float | None
    reason: str = ""

    @property
    def unusual(self) -> bool:
        """A start or stop crater, a bulge or a tail: wider or narrower by more than 15 %."""
        return self.ratio is not None and abs(self.ratio - 1.0) > _UNUSUAL


def bead_ends(bead: BeadMeasurement) -> list[BeadEnd]:
    """Start and stop: the mean width over one and a half widths behind the round end."""
    usual = float(np.nanmedian(bead.width[bead.good])) if bead.good.any() else float("nan")
    known = zip(("start", "stop"), (bead.open_start, bead.open_stop), strict=True)
    return [_end(bead, name, outside, usual) for name, outside in known]


def _end(bead: BeadMeasurement, name: str, outside: bool, usual: float) -> BeadEnd:
    place = float(bead.s[0] if name == "start" else bead.s[-1])
    if outside:
        return BeadEnd(name, place, None, f"the {name} of the bead is not in the photo")
    away = np.abs(bead.s - place)
    near = bead.good & (away > _ROUND * usual) & (away < (_ROUND + _LENGTH) * usual)
    if near.sum() < 3:
        return BeadEnd(name, place, None, f"no width could be measured near the {name}")
    return BeadEnd(name, place, float(np.mean(bead.width[near])) / usual)


@dataclass(frozen=True, slots=True)
class Gap:
    """A stretch without width: `missing` if there is no bead, else the toes are not visible."""

    start: float
    stop: float
    reason: str

    @property
    def missing(self) -> bool:
        """Whether the bead itself is missing there."""
        return self.reason == NO_BEAD

    @property
    def length(self) -> float:
        """Length along the bead."""
        return self.stop - self.start


def bead_gaps(bead: BeadMeasurement) -> list[Gap]:
    """Stretches of 1 mm or more without a width, the round ends left out."""
    return [
        Gap(float(bead.s[first]), float(bead.s[last]), reason)
        for first, last, reason in gaps(bead)
        if reason != END
    ]
