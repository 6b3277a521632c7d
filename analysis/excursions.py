"""Where the bead leaves its band, and which logged channel moved there."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BAND_SPREADS = 3.0
_SMALLEST = 0.03
"""Half width of the band as a part of the median: less is no excursion, however even the bead."""
_SHORTEST_MM = 1.0
_MERGED_MM = 5.0
_MOVED = 3.0
_LAG_MM = 10.0


@dataclass(frozen=True, slots=True)
class Band:
    """Limits of the width in mm and where they come from."""

    low_mm: float
    high_mm: float
    source: str


@dataclass(frozen=True, slots=True)
class Excursion:
    """A stretch outside the band: stations `first` to `last`, place and width of its peak.

    `s_mm` is the middle of the excursion, weighted by how far the width is off.
    """

    first: int
    last: int
    s_mm: float
    peak_width_mm: float


@dataclass(frozen=True, slots=True)
class Cause:
    """A channel at an excursion: its mean there against its usual value.

    `score` is the difference in standard deviations of what equally long stretches elsewhere do;
    `correlation` that of the width with the channel around the excursion. Channels are ranked by
    `weight`, the product of both: a cause is unusual there and the width goes along with it.
    """

    channel: str
    score: float
    correlation: float
    there: float
    usual: float

    @property
    def weight(self) -> float:
        """What the ranking goes by."""
        return self.score * abs(self.correlation)

    @property
    def moved(self) -> bool:
        """Whether the channel did what it hardly does elsewhere."""
        return self.score >= _MOVED


def _spread(values: Floats) -> float:
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def usual_band(width_mm: Floats, low_mm: float | None, high_mm: float | None) -> Band:
    """The user's limits, or the median +- three robust standard deviations (at least 3 %)."""
    known = width_mm[np.isfinite(width_mm)]
    middle = float(np.median(known))
    half = max(BAND_SPREADS * _spread(known), _SMALLEST * middle)
    if low_mm is None and high_mm is None:
        text = "median +- 3 robust standard deviations of this bead"
        return Band(middle - half, middle + half, text)
    low = -np.inf if low_mm is None else low_mm
    high = np.inf if high_mm is None else high_mm
    return Band(low, high, "limits of the configuration")


def find_excursions(
    s_mm: Floats, width_mm: Floats, u_mm: Floats | float, band: Band
) -> list[Excursion]:
    """Stretches outside `band` by more than U = 2 u; near ones on the same side are one."""
    calm = _running_median(width_mm, 5)
    guard = 2.0 * np.asarray(u_mm)
    found = []
    for side, outside in ((1, calm - guard > band.high_mm), (-1, calm + guard < band.low_mm)):
        for first, last in _runs(outside, s_mm):
            if s_mm[last] - s_mm[first] >= _SHORTEST_MM:
                found.append(_excursion(s_mm, calm, band, side, first, last))
    return sorted(found, key=lambda excursion: excursion.s_mm)


def _excursion(
    s_mm: Floats, width_mm: Floats, band: Band, side: int, first: int, last: int
) -> Excursion:
    there = slice(first, last + 1)
    limit = band.high_mm if side > 0 else band.low_mm
    off = np.clip(side * (width_mm[there] - limit), 0, None)
    weight = np.nan_to_num(off) + 1e-9
    peak = width_mm[there][int(np.nanargmax(off))]
    return Excursion(first, last, float(np.average(s_mm[there], weights=weight)), float(peak))


def _runs(outside: NDArray[np.bool_], s_mm: Floats) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(np.int8), [0]])))
    merged: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2):
        if merged and s_mm[start] - s_mm[merged[-1][1]] < _MERGED_MM:
            merged[-1] = (merged[-1][0], int(stop - 1))
        else:
            merged.append((int(start), int(stop - 1)))
    return merged


def _running_median(values: Floats, size: int) -> Floats:
    padded = np.pad(values, size // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, size)
    some = np.isfinite(windows).any(axis=1)
    result = np.full(len(values), np.nan)
    result[some] = np.nanmedian(windows[some], axis=1)
    return result


def rank_causes(
    excursion: Excursion,
    width_mm: Floats,
    channels: Mapping[str, Floats],
    least: Mapping[str, float],
) -> list[Cause]:
    """Channels by their weight as a cause of the excursion, the weightiest first.

    `least` gives for each channel a standard deviation below which a difference means nothing.
    Channels that were not logged there are left out.
    """
    causes = []
    for name, values in channels.items():
        cause = _cause(excursion, name, width_mm, values, least.get(name, 0.0))
        if cause is not None:
            causes.append(cause)
    return sorted(causes, key=lambda cause: cause.weight, reverse=True)


def _cause(
    excursion: Excursion, name: str, width_mm: Floats, values: Floats, least: float
) -> Cause | None:
    length = excursion.last - excursion.first + 1
    there = values[excursion.first : excursion.last + 1]
    away = np.ones(len(values), dtype=bool)
    away[max(0, excursion.first - length) : excursion.last + 1 + length] = False
    elsewhere = _means(np.where(away, values, np.nan), length)
    if np.isfinite(there).mean() < 0.5 or len(elsewhere) < 2:
        return None
    usual = float(np.median(elsewhere))
    mean = float(np.nanmean(there))
    spread = max(_spread(elsewhere), least, 1e-12)
    near = slice(max(0, excursion.first - 2 * length), excursion.last + 1 + 2 * length)
    correlation = _correlation(width_mm[near], values[near])
    return Cause(name, abs(mean - usual) / spread, correlation, mean, usual)


def _correlation(width_mm: Floats, values: Floats) -> float:
    known = np.isfinite(width_mm) & np.isfinite(values)
    if known.sum() < 8 or np.ptp(width_mm[known]) == 0 or np.ptp(values[known]) == 0:
        return 0.0
    return float(np.corrcoef(width_mm[known], values[known])[0, 1])


def _means(values: Floats, length: int) -> Floats:
    """Means of stretches of `length` that overlap by half; those with gaps are left out."""
    starts = range(0, len(values) - length + 1, max(1, length // 2))
    means = np.array([values[start : start + length].mean() for start in starts])
    return np.asarray(means[np.isfinite(means)])


def lagged_correlation(
    s_mm: Floats, width_mm: Floats, values: Floats
) -> tuple[float, float] | None:
    """Correlation of largest magnitude within +-10 mm, and its lag in mm.

    A positive lag: the width answers behind the channel. None where either stays constant.
    """
    step = float(np.median(np.diff(s_mm)))
    best: tuple[float, float] | None = None
    for shift in range(-round(_LAG_MM / step), round(_LAG_MM / step) + 1):
        width = width_mm[max(0, shift) : len(width_mm) + min(0, shift)]
        channel = values[max(0, -shift) : len(values) + min(0, -shift)]
        r = _correlation(width, channel)
        if r and (best is None or abs(r) > abs(best[0])):
            best = (r, shift * step)
    return best
