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
_SHORTEST = 2
"""Sections from the first to the last that make a band: fewer have no direction."""
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


class _Sums:
    """Running sums along each section, so that any window's mean is a difference of two slices.

    Kept as (features, rows, columns), padded so that windows may reach over the borders.
    """

    def __init__(self, features: Floats) -> None:
        self.columns = features.shape[1]
        planes = np.ascontiguousarray(np.moveaxis(features, 2, 0))
        self._first, self._second = self._running(planes), self._running(planes * planes)

    def _running(self, planes: Floats) -> Floats:
        total = np.cumsum(planes, axis=2, dtype=np.float64).astype(np.float32)
        pads = ((0, 0), (0, 0), (self.columns + 1, self.columns))
        return np.pad(np.pad(total, (*pads[:2], (0, 0))), pads, mode="edge") * self._known(pads)

    def _known(self, pads: tuple[tuple[int, int], ...]) -> Floats:
        """0 left of the first column, where an edge pad would repeat its sum, else 1."""
        known = np.ones(self.columns + sum(pads[2]), dtype=np.float32)
        known[: pads[2][0]] = 0
        return known

    def window(self, centres: range, start: int, stop: int) -> tuple[Floats, Floats]:
        """Mean and variance of columns [c + start, c + stop) for each c, (features, rows, c)."""
        at = np.arange(centres.start, centres.stop)
        inside = np.clip(at + stop, 0, self.columns) - np.clip(at + start, 0, self.columns)
        count = np.maximum(inside, 1).astype(np.float32)
        mean = self._between(self._first, centres, start, stop) / count
        square = self._between(self._second, centres, start, stop) / count
        return mean, np.maximum(square - mean * mean, 0)

    def _between(self, sums: Floats, centres: range, start: int, stop: int) -> Floats:
        first, last = centres.start + self.columns, centres.stop + self.columns
        return np.asarray(
            sums[..., first + stop : last + stop] - sums[..., first + start : last + start]
        )


def _saturate(square: Floats, half_at: float) -> Floats:
    return square / (square + np.float32(half_at))


def edge_evidence(features: Features, reach: int) -> Floats:
    """How sharply the features change at each column edge (0 to 1), shape (rows, columns + 1).

    The change between the two windows of `reach` columns on both sides, against their spread.
    """
    return _edges(_Sums(features), features.shape[0], reach)


def _edges(sums: _Sums, rows: int, reach: int) -> Floats:
    at = range(reach, sums.columns - reach + 1)
    mean_a, var_a = sums.window(at, -reach, 0)
    mean_b, var_b = sums.window(at, 0, reach)
    square = ((mean_a - mean_b) ** 2 / (0.5 * (var_a + var_b) + _FLOOR)).sum(axis=0)
    result = np.zeros((rows, sums.columns + 1), dtype=np.float32)
    result[:, at.start : at.stop] = _saturate(square, 1.5)
    return result


def _contrast(sums: _Sums, centres: range, half: int) -> Floats:
    """Fisher contrast of a band against both its sides as one (0 to 1), shape (rows, centres).

    Taking the sides together keeps a shadow between bead and plate from looking like a band:
    its sides differ from each other more than from it. A band with more texture than its sides
    counts up to a quarter more.
    """
    reach = max(4, 2 * half)
    inside, spread = sums.window(centres, -half, half)
    one, spread_one = sums.window(centres, -half - reach, -half)
    two, spread_two = sums.window(centres, half, half + reach)
    apart = (spread_one + spread_two) / 2 + ((one - two) / 2) ** 2
    square = (inside - (one + two) / 2) ** 2 / (0.5 * (spread + apart) + _FLOOR)
    rougher = np.maximum(inside[-1] - np.maximum(one[-1], two[-1]), 0)
    return np.asarray(_saturate(square.sum(axis=0), 2.0) * (1 + 0.25 * np.tanh(rougher)))


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
        band's centre, or by its width as well (`holding`); `widest` leaves broader ones out.
        """
        keep = 2 * self._halves <= max(widest, 2 * self._halves[0])
        score = self._evidence[:, :, keep]
        if allowed is not None:
            by_row = allowed if allowed.ndim > 1 else allowed[None]
            score = score * (by_row if allowed.ndim == 3 else by_row[:, :, None])
        band = _trace(score, self._centres, self._halves[keep], self._slope)
        return band if band is not None and band.last - band.first >= _SHORTEST else None

    def holding(self, column: float, slack: float) -> Floats:
        """Weight of bands that hold a column, (1, columns + 1, widths): 1, or less beside it."""
        beside = np.abs(self._centres[:, None] - np.float32(column)) - self._halves
        return np.exp(-0.5 * (np.maximum(beside, 0) / np.float32(slack)) ** 2)[None]

    def _score(self, features: Features) -> Floats:
        """Evidence per section, centre and half width, shape (rows, centres, halves)."""
        rows, sums = len(features), _Sums(features)
        edges = np.maximum(_edges(sums, rows, 2), _edges(sums, rows, 4))
        near = edges.copy()
        near[:, 1:] = np.maximum(near[:, 1:], edges[:, :-1])
        near[:, :-1] = np.maximum(near[:, :-1], edges[:, 1:])
        score = np.zeros((rows, len(self._centres), len(self._halves)), dtype=np.float32)
        for k, exact in enumerate(self._halves):
            half = max(1, round(float(exact)))
            whole = range(half + 1, self.columns - half)
            if len(whole):
                left = near[:, whole.start - half : whole.stop - half]
                right = near[:, whole.start + half : whole.stop + half]
                broad = np.float32((2 * float(exact) / self.columns) ** _BROAD)
                sharp = np.sqrt(np.sqrt(left * right))
                score[:, whole.start : whole.stop, k] = _contrast(sums, whole, half) * sharp * broad
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
