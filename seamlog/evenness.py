"""How evenly times follow each other: period, jitter, gaps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GAP = 1.5
"""A step above this many periods is a gap."""


@dataclass(frozen=True, slots=True)
class Evenness:
    """The usual period (the median step), and where it is not kept.

    `jitter_s` is half the range that 90 % of the steps without gaps lie in; `repeated` counts times
    that equal the one before.
    """

    period_s: float
    jitter_s: float
    gaps: int
    longest_gap_s: float
    repeated: int


def evenness_of(times_ns: NDArray[np.int64]) -> Evenness | None:
    """Evenness of times that do not decrease; None for fewer than three different ones."""
    steps = np.diff(times_ns)
    real = steps[steps > 0]
    if len(real) < 2:
        return None
    period = float(np.median(real))
    gaps = real > GAP * period
    low, high = np.percentile(real[~gaps], (5, 95))
    return Evenness(
        period_s=period * 1e-9,
        jitter_s=float(high - low) / 2e9,
        gaps=int(gaps.sum()),
        longest_gap_s=float(real.max()) * 1e-9,
        repeated=len(steps) - len(real),
    )
