"""Process capability of the width along a bead, with confidence intervals.

Neighbouring stations are alike, so the number of stations says little: intervals go by the number
of independent ones, from the autocorrelation of the width.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

Floats = NDArray[np.float64]

CONFIDENCE = 0.95
_FEWEST = 5.0


@dataclass(frozen=True, slots=True)
class Capability:
    """Cp (None with one limit only) and Cpk, each with its interval at 95 %.

    `independent` is the effective number of stations.
    """

    cp: float | None
    cp_low: float | None
    cp_high: float | None
    cpk: float
    cpk_low: float
    cpk_high: float
    independent: float


def capability(
    width: Floats, std: float, lower: float | None, upper: float | None
) -> Capability | None:
    """Capability of widths (n,) against limits; `std` is their spread without measurement noise.

    None without limits, without spread, or with fewer than five independent stations. Intervals:
    chi-square for Cp, Bissell (1990) for Cpk.
    """
    count = independent_count(width)
    if (lower is None and upper is None) or std <= 0 or count < _FEWEST:
        return None
    mean = float(np.mean(width))
    sides = [] if upper is None else [(upper - mean) / (3 * std)]
    sides += [] if lower is None else [(mean - lower) / (3 * std)]
    cpk = min(sides)
    z = float(special.ndtri(0.5 + CONFIDENCE / 2))
    half = z * float(np.sqrt(1 / (9 * count) + cpk**2 / (2 * (count - 1))))
    cp = low = high = None
    if lower is not None and upper is not None:
        cp = (upper - lower) / (6 * std)
        tail = (1 - CONFIDENCE) / 2
        low, high = (
            cp * float(np.sqrt(special.chdtri(count - 1, 1 - part) / (count - 1)))
            for part in (tail, 1 - tail)
        )
    return Capability(cp, low, high, cpk, cpk - half, cpk + half, count)


def independent_count(values: Floats) -> float:
    """Effective number of independent values in a series: n / (1 + 2 sum of autocorrelation).

    The sum ends where the autocorrelation first falls below zero.
    """
    count = len(values)
    away = values - values.mean()
    power = float(away @ away)
    if count < 2 or power <= 0:
        return float(count)
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(away, size)
    correlation = np.fft.irfft(spectrum * np.conj(spectrum), size)[:count] / power
    below = np.flatnonzero(correlation < 0)
    stop = int(below[0]) if len(below) else count
    return float(np.clip(count / (1 + 2 * correlation[1:stop].sum()), 1.0, count))
