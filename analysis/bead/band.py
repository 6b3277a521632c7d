"""Finding the band that differs from both its sides: the bead as a whole, before its toes.

Sections run along the rows of a feature picture. Each state is a pair (left edge, right edge);
dynamic programming from section to section finds the pair sequence with the most evidence, with
free start and stop, so that a bead that ends inside the picture ends there.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .features import Features, robust_scale

Floats = NDArray[np.float32]

_EVIDENT = 0.35
"""Evidence per section (0 to 1) above which a section counts for a bead."""
_MOVE_COST = 0.02
_WIDEN_COST = 0.4
"""A bead keeps its width: what a change by a tenth costs, in sections of full evidence."""
_BROAD = 0.12
"""Power of the width that evidence grows with: of two bands as evident the broader tells more."""
_FLOOR = 0.15
"""Variance (of scaled features) that any zone has, however flat it looks."""


@dataclass(frozen=True, slots=True)
class Band:
    """A band over the sections `first` to `last` (inclusive); edges in columns, one per section.

    `evidence` is 0 to 1 per section; `total` its sum above the threshold, for comparison.
    """

    first: int
    last: int
    left: NDArray[np.float64]
    right: NDArray[np.float64]
    evidence: NDArray[np.float64]
    total: float


@dataclass(frozen=True, slots=True)
class _Sums:
    """Running sums along each section, so that any window's mean is two look-ups."""

    first: Floats
    second: Floats

    def window(self, start: NDArray[np.int64], stop: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Mean and variance per feature of columns [start, stop), shape (rows, windows, k)."""
        count = np.maximum(stop - start, 1)[None, :, None].astype(np.float32)
        mean = (self.first[:, stop] - self.first[:, start]) / count
        square = (self.second[:, stop] - self.second[:, start]) / count
        return mean, np.maximum(square - mean * mean, 0)


def _sums(features: Floats) -> _Sums:
    def running(values: Floats) -> Floats:
        zero = np.zeros((values.shape[0], 1, values.shape[2]), dtype=np.float32)
        total = np.cumsum(values, axis=1, dtype=np.float64).astype(np.float32)
        return np.concatenate([zero, total], axis=1)

    return _Sums(running(features), running(features * features))


def _saturate(square: Floats, half_at: float) -> Floats:
    return square / (square + np.float32(half_at))


def edge_evidence(features: Floats, reach: int) -> Floats:
    """How sharply the features change at each column edge (0 to 1), shape (rows, columns + 1).

    The change between the two windows of `reach` columns on both sides, against their spread.
    """
    columns = features.shape[1]
    at = np.arange(reach, columns - reach + 1)
    sums = _sums(features)
    mean_a, var_a = sums.window(at - reach, at)
    mean_b, var_b = sums.window(at, at + reach)
    square = ((mean_a - mean_b) ** 2 / (0.5 * (var_a + var_b) + _FLOOR)).sum(axis=2)
    result = np.zeros((features.shape[0], columns + 1), dtype=np.float32)
    result[:, at] = _saturate(square, 1.5)
    return result


def _contrast(sums: _Sums, centres: Floats, half: float) -> Floats:
    """Fisher contrast of a band against both its sides as one (0 to 1), shape (rows, centres).

    Taking the sides together keeps a shadow between bead and plate from looking like a band:
    its sides differ from each other more than from it. A band with more texture than its sides
    counts up to a quarter more.
    """
    columns = sums.first.shape[1] - 1
    left = np.rint(centres - half).astype(np.int64)
    right = np.rint(centres + half).astype(np.int64)
    reach = max(4, round(2.0 * half))
    inside, spread = sums.window(left, right)
    one, spread_one = sums.window(np.maximum(left - reach, 0), left)
    two, spread_two = sums.window(right, np.minimum(right + reach, columns))
    outside = (one + two) / 2
    apart = (spread_one + spread_two) / 2 + ((one - two) / 2) ** 2
    square = ((inside - outside) ** 2 / (0.5 * (spread + apart) + _FLOOR)).sum(axis=2)
    rougher = inside[..., -1] - np.maximum(one[..., -1], two[..., -1])
    return _saturate(square, 2.0) * (1 + 0.25 * np.tanh(np.maximum(rougher, 0))).astype(np.float32)


class BandSearch:
    """Evidence for all bands of `narrowest` to `widest` columns in one feature picture.

    `slope` is the number of columns the centre may move from one section to the next.
    """

    def __init__(self, features: Features, narrowest: float, widest: float, slope: int = 1) -> None:
        self.rows, self.columns = features.shape[:2]
        self._slope = slope
        count = max(4, int(np.ceil(np.log(widest / narrowest) / np.log(1.13))) + 1)
        self._halves = (np.geomspace(narrowest, widest, count) / 2).astype(np.float32)
        self._centres = np.arange(self.columns + 1, dtype=np.float32)
        self._evidence = self._score((features / robust_scale(features)).astype(np.float32))

    def best(self, allowed: Floats | None = None, widest: float = np.inf) -> Band | None:
        """The band with the most evidence, or None without any.

        `allowed`, shape (columns + 1,) or (rows, columns + 1), multiplies the evidence by the
        band's centre; `widest` leaves broader ones out.
        """
        keep = 2 * self._halves <= max(widest, 2 * self._halves[0])
        score = self._evidence[:, :, keep]
        if allowed is not None:
            score = score * (allowed if allowed.ndim == 2 else allowed[None])[:, :, None]
        return _trace(score, self._centres, self._halves[keep], self._slope)

    def _score(self, features: Floats) -> Floats:
        """Evidence per section, centre and half width, shape (rows, centres, halves)."""
        edges = np.maximum(edge_evidence(features, 2), edge_evidence(features, 4))
        near = edges.copy()
        near[:, 1:] = np.maximum(near[:, 1:], edges[:, :-1])
        near[:, :-1] = np.maximum(near[:, :-1], edges[:, 1:])
        sums = _sums(features)
        shape = (len(features), len(self._centres), len(self._halves))
        score = np.zeros(shape, dtype=np.float32)
        for k, half in enumerate(self._halves):
            left = np.rint(self._centres - half).astype(np.int64)
            right = np.rint(self._centres + half).astype(np.int64)
            whole = np.flatnonzero((left >= 1) & (right <= self.columns - 1))
            if len(whole):
                pair = np.sqrt(near[:, left[whole]] * near[:, right[whole]])
                inside = _contrast(sums, self._centres[whole], float(half))
                broad = (2 * half / self.columns) ** _BROAD
                score[:, whole, k] = inside * np.sqrt(pair) * broad
        return score


def _trace(score: Floats, centres: Floats, halves: Floats, slope: int) -> Band | None:
    """Dynamic programming over the sections with free start and stop."""
    moves = [(dc, dh) for dc in range(-slope, slope + 1) for dh in (-1, 0, 1)]
    rows, wide, high = score.shape
    padded = np.full((wide + 2 * slope, high + 2), -np.inf, dtype=np.float32)
    value = np.zeros((wide, high), dtype=np.float32)
    came = np.full(score.shape, -1, dtype=np.int8)
    totals = np.empty(rows, dtype=np.float64)
    ends = np.empty(rows, dtype=np.int64)
    for row in range(rows):
        padded[slope : slope + wide, 1 : 1 + high] = value
        best = np.zeros_like(value)
        for index, (dc, dh) in enumerate(moves):
            cost = np.float32(_MOVE_COST * abs(dc) + _WIDEN_COST * abs(dh))
            other = padded[slope - dc : slope - dc + wide, 1 - dh : 1 - dh + high] - cost
            came[row][other > best] = index
            np.maximum(best, other, out=best)
        value = best + score[row] - np.float32(_EVIDENT)
        ends[row] = int(np.argmax(value))
        totals[row] = value.flat[ends[row]]
    last = int(np.argmax(totals))
    if totals[last] <= 0:
        return None
    return _walk_back(score, came, moves, centres, halves, last, int(ends[last]), totals[last])


def _walk_back(
    score: Floats,
    came: NDArray[np.int8],
    moves: list[tuple[int, int]],
    centres: Floats,
    halves: Floats,
    last: int,
    end: int,
    total: float,
) -> Band:
    c, h = divmod(end, len(halves))
    path = []
    row = last
    while row >= 0:
        path.append((c, h, score[row, c, h]))
        move = came[row, c, h]
        if move < 0:
            break
        c, h = c - moves[move][0], h - moves[move][1]
        row -= 1
    at = np.array([(c, h) for c, h, _ in reversed(path)])
    evidence = np.array([float(e) for _, _, e in reversed(path)])
    middle, half = centres[at[:, 0]].astype(np.float64), halves[at[:, 1]].astype(np.float64)
    return Band(last - len(at) + 1, last, middle - half, middle + half, evidence, float(total))
