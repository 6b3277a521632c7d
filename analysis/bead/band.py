"""Finding the band that differs from both its sides: the bead as a whole, before its toes.

Sections run along the rows of a feature picture. Each state is a pair (left edge, right edge);
dynamic programming from section to section finds the pair sequence with the most evidence, with
free start and stop, so that a bead that ends inside the picture ends there.
"""

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from . import loops
from .features import Features, Planes, in_spreads, planes_of
from .loops import loaded
from .series import median

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
_NEGLIGIBLE = 0.02
"""Weight below which a band is not looked at."""
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

    @property
    def middle(self) -> NDArray[np.float64]:
        """Column of its middle."""
        return (self.left + self.right) / 2


def relative(other: Band | None, band: Band) -> float:
    """Evidence of another band as a part of that of `band`; 0 without another one."""
    return other.total / band.total if other else 0.0


class _Sums:
    """Running sums along each section, so that any window's sum is a difference of two slices.

    Of the features and of their squares, (2, features, rows, columns), padded so that windows may
    reach over the borders.
    """

    def __init__(self, planes: Planes) -> None:
        count, rows, self.columns = planes.shape
        total = np.cumsum(np.stack([planes, planes * planes]), axis=3, dtype=np.float64)
        size = 3 * self.columns + 1
        self.sums = np.zeros((2, count, rows, size), dtype=np.float32)
        self.sums[..., self.columns + 1 : 2 * self.columns + 1] = total
        self.sums[..., 2 * self.columns + 1 :] = total[..., -1:]
        self.known = np.clip(np.arange(size) - self.columns, 0, self.columns).astype(np.float32)


def _saturate(square: Floats, half_at: float) -> Floats:
    return square / (square + np.float32(half_at))


def edge_evidence(planes: Planes, reach: int) -> Floats:
    """How sharply the features change at each column edge (0 to 1), shape (rows, columns + 1).

    The change between the two windows of `reach` columns on both sides, against their spread.
    """
    _, rows, columns = planes.shape
    both = np.full(2 * reach, 0.5 / reach)
    change = _summed(planes, np.repeat([-1.0, 1.0], reach) / reach)
    mean, square = _summed(planes, both), _summed(planes * planes, both)
    result = np.zeros((rows, columns + 1), dtype=np.float32)
    inner = slice(reach, columns - reach + 1)
    evident = loaded(loops.evident) or _evident
    result[:, inner] = evident(change, mean, square, np.float32(_FLOOR))[:, inner]
    return result


def _evident(change: Planes, mean: Planes, square: Planes, floor: np.float32) -> Floats:
    """Evidence by the change between two windows, the mean of both and of their squares."""
    change = change * change
    spread = square - mean * mean - change / 4
    change /= np.maximum(spread, 0, out=spread) + floor
    return _saturate(change.sum(axis=0), 1.5)


def _summed(planes: Planes, weights: NDArray[np.float64]) -> Planes:
    """Weighted sums of the columns around each column edge."""
    flat = planes.reshape(-1, planes.shape[2])
    found = cv2.filter2D(flat, -1, weights[None].astype(np.float32))
    return np.asarray(found, dtype=np.float32).reshape(planes.shape)


def _contrast(sums: _Sums, centres: range, half: int) -> Floats:
    """Fisher contrast of a band against both its sides as one (0 to 1), shape (rows, centres).

    Each side is as broad as the band. Taking them together keeps a shadow between bead and plate
    from looking like a band: its sides differ from each other more than from it. A band with more
    texture than its sides counts up to a quarter more.
    """
    where = centres.start + sums.columns, len(centres), half
    contrasted = loaded(loops.contrasted) or _contrasted
    contrast, rougher = contrasted(sums.sums, sums.known, *where, np.float32(2 * _FLOOR))
    return np.asarray(contrast * (1 + 0.25 * np.tanh(rougher)))


def _contrasted(
    sums: Floats, known: Floats, start: int, count: int, half: int, floor: np.float32
) -> tuple[Floats, Floats]:
    """Contrast, and by how much the band is rougher than both its sides, (rows, count) each."""

    def between(values: Floats, first: int, stop: int) -> Floats:
        up_to, before = (slice(start + at, start + at + count) for at in (stop, first))
        return np.asarray(values[..., up_to] - values[..., before])

    band, own = between(sums, -half, half), between(known, -half, half)
    sides = between(sums, -3 * half, 3 * half) - band
    sides *= 1 / np.maximum(between(known, -3 * half, 3 * half) - own, 1)
    band *= 1 / own
    (inside, square), (around, square_around) = band, sides
    twice_spread = square + square_around - inside * inside - around * around
    change = (inside - around) ** 2 / (np.maximum(twice_spread, 0) + floor)
    beside = (
        between(sums[0, -1], *side) * (1 / np.maximum(between(known, *side), 1))
        for side in ((-3 * half, -half), (half, 3 * half))
    )
    rougher = np.maximum(inside[-1] - np.maximum(*beside), 0)
    return _saturate(change.sum(axis=0), 1.0), rougher


class BandSearch:
    """Evidence for all bands of `narrowest` to `widest` columns in one feature picture.

    `slope` is the number of columns the centre may move from one section to the next. Of bands
    that do not hold the column `held[0]` the evidence counts less, by a Gaussian of their distance
    from it with the sigma `held[1]`.
    """

    def __init__(
        self,
        features: Features,
        narrowest: float,
        widest: float,
        slope: int = 1,
        held: tuple[float, float] | None = None,
    ) -> None:
        self.rows, self.columns = features.shape[:2]
        self._slope = slope
        count = max(4, int(np.ceil(np.log(widest / narrowest) / np.log(1.13))) + 1)
        self._halves = (np.geomspace(narrowest, widest, count) / 2).astype(np.float32)
        weight = (2 * self._halves[:, None] / self.columns) ** np.float32(_BROAD)
        column, slack = held or (self.columns / 2, np.inf)
        beside = np.abs(np.arange(self.columns + 1) - column) - self._halves[:, None]
        weight = weight * np.exp(-0.5 * (np.maximum(beside, 0) / slack) ** 2)
        self._evidence = self._score(in_spreads(planes_of(features)), weight.astype(np.float32))

    def best(self, allowed: Floats | None = None, widest: float = np.inf) -> Band | None:
        """The band with the most evidence, or None without any.

        `allowed`, shape (columns + 1,) or (rows, columns + 1), multiplies the evidence by the
        band's centre; `widest` leaves broader ones out.
        """
        keep = 2 * self._halves <= max(widest, 2 * self._halves[0])
        score = self._evidence[:, keep]
        if allowed is not None:
            score = score * np.atleast_2d(allowed)[:, None]
        band = _trace(score, self._halves[keep], self._slope)
        return band if band is not None and band.last - band.first >= _SHORTEST else None

    def beside(self, band: Band) -> Band | None:
        """The best band with its middle outside `band` and its margin."""
        allowed = np.ones((self.rows, self.columns + 1), dtype=np.float32)
        allowed[band.first : band.last + 1][self._away(band) < 1.6] = 0
        return self.best(allowed)

    def inside(self, band: Band) -> Band | None:
        """The best band of at most two thirds of the width near the middle of `band`."""
        allowed = np.zeros((self.rows, self.columns + 1), dtype=np.float32)
        allowed[band.first : band.last + 1][self._away(band) < 0.4] = 1
        return self.best(allowed, max(4.0, 0.65 * median(band.right - band.left)))

    def _away(self, band: Band) -> NDArray[np.float64]:
        """Distance of each column edge from the band's middle, in half widths, by row of it."""
        columns = np.arange(self.columns + 1)
        distance = np.abs(columns - band.middle[:, None])
        return np.asarray(distance / ((band.right - band.left)[:, None] / 2))

    def _score(self, planes: Planes, weight: Floats) -> Floats:
        """Evidence per section, half width and centre, shape (rows, halves, centres).

        `weight`, (halves, centres), multiplies it.
        """
        sums = _Sums(planes)
        edges = np.maximum(edge_evidence(planes, 2), edge_evidence(planes, 4))
        near = np.sqrt(np.sqrt(cv2.dilate(edges, np.ones((1, 3), np.uint8))))
        score = np.zeros((self.rows, *weight.shape), dtype=np.float32)
        whole = np.maximum(1, np.rint(self._halves)).astype(int)
        for half in np.unique(whole).tolist():
            alike = whole == half
            counts = weight[alike].max(axis=0)[half + 1 : self.columns - half] > _NEGLIGIBLE
            if counts.any():
                first, last = half + 1 + np.flatnonzero(counts)[[0, -1]]
                at = range(first, last + 1)
                left, right = (near[:, at.start + out : at.stop + out] for out in (-half, half))
                found = _contrast(sums, at, half) * left * right
                score[:, alike, at.start : at.stop] = (
                    found[:, None] * weight[alike, first : last + 1]
                )
        return score


def _trace(score: Floats, halves: Floats, slope: int) -> Band | None:
    """Dynamic programming over the sections with free start and stop."""
    rows, _, wide = score.shape
    stride = wide + 2 * slope
    gather = loaded(loops.gathered) or _gathered
    costs = (np.float32(_EVIDENT), np.float32(_WIDEN_COST), np.float32(_MOVE_COST))
    gathered = gather(score, *costs, slope).reshape(rows, -1)
    ends = gathered.argmax(axis=1)
    totals = gathered[np.arange(rows), ends]
    last = int(totals.argmax())
    if totals[last] <= 0:
        return None
    dc, dh = (move.ravel() for move in np.mgrid[-slope : slope + 1, -1:2])
    cost = (_MOVE_COST * abs(dc) + _WIDEN_COST * abs(dh)).astype(np.float32)
    walk = loaded(loops.walked_back) or _walked_back
    states = walk(gathered[: last + 1], int(ends[last]), dc + stride * dh, cost)[::-1]
    first = last + 1 - len(states)
    h, c = states // stride - 1, states % stride - slope
    evidence = score[np.arange(first, last + 1), h, c].astype(np.float64)
    half = halves[h].astype(np.float64)
    return Band(first, last, c - half, c + half, evidence, float(totals[last]))


def _gathered(
    score: Floats, evident: np.float32, widen: np.float32, move: np.float32, slope: int
) -> Floats:
    """The most evidence gathered by each state, (rows, halves + 2, centres + 2 slope).

    A row's states lie flat, their edges padded, so that a move is a shift.
    """
    rows, high, wide = score.shape
    stride = wide + 2 * slope
    padded = np.full((rows, high + 2, stride), -np.inf, dtype=np.float32)
    padded[:, 1:-1, slope : slope + wide] = score - evident
    for before, now in itertools.pairwise(padded.reshape(rows, -1)):
        best = np.maximum(before[: -2 * stride], before[2 * stride :]) - widen
        np.maximum(best, before[stride:-stride], out=best)
        for _ in range(slope):
            moved = np.maximum(best[:-2], best[2:]) - move
            np.maximum(best[1:-1], moved, out=best[1:-1])
        now[stride:-stride] += np.maximum(best, 0, out=best)
    return padded


def _walked_back(
    gathered: Floats, end: int, moves: NDArray[np.int64], costs: Floats
) -> NDArray[np.int64]:
    """The states that lead to the state `end` of the last row, from it to the first."""
    states = [end]
    for before in gathered[-2::-1]:
        came = states[-1] - moves
        value = before[came] - costs
        best = value.argmax()
        if value[best] <= 0:
            break
        states.append(came[best])
    return np.array(states)
