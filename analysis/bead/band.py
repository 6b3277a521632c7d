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

from .features import Features, Planes, in_spreads, planes_of
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


def relative(other: Band | None, band: Band) -> float:
    """How evident another band is, 0 to 1, if it is less so than `band`."""
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
        self._sums = np.zeros((2, count, rows, size), dtype=np.float32)
        self._sums[..., self.columns + 1 : 2 * self.columns + 1] = total
        self._sums[..., 2 * self.columns + 1 :] = total[..., -1:]
        self._known = np.clip(np.arange(size) - self.columns, 0, self.columns).astype(np.float32)

    def over(self, centres: range, start: int, stop: int) -> tuple[Floats, Floats]:
        """Sums over the columns [c + start, c + stop) that there are, and how many, for each c.

        Shapes (2, features, rows, c) and (c,).
        """
        before, up_to = self._slices(centres, start, stop)
        sums = self._sums[..., up_to] - self._sums[..., before]
        return sums, self._known[up_to] - self._known[before]

    def roughness(self, centres: range, start: int, stop: int) -> Floats:
        """Means of the last feature over columns [c + start, c + stop), (rows, c)."""
        before, up_to = self._slices(centres, start, stop)
        sums = self._sums[0, -1, :, up_to] - self._sums[0, -1, :, before]
        sums /= np.maximum(self._known[up_to] - self._known[before], 1)
        return np.asarray(sums)

    def _slices(self, centres: range, start: int, stop: int) -> tuple[slice, slice]:
        first, last = centres.start + self.columns, centres.stop + self.columns
        return slice(first + start, last + start), slice(first + stop, last + stop)


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
    change *= change
    spread = square - mean * mean - change / 4
    change /= np.maximum(spread, 0, out=spread) + np.float32(_FLOOR)
    result = np.zeros((rows, columns + 1), dtype=np.float32)
    inner = slice(reach, columns - reach + 1)
    result[:, inner] = _saturate(change.sum(axis=0)[:, inner], 1.5)
    return result


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
    band, own = sums.over(centres, -half, half)
    sides, known = sums.over(centres, -3 * half, 3 * half)
    sides -= band
    sides /= np.maximum(known - own, 1)
    band /= own
    (inside, square), (around, square_around) = band, sides
    twice_spread = square + square_around - inside * inside - around * around
    change = (inside - around) ** 2 / (np.maximum(twice_spread, 0) + np.float32(2 * _FLOOR))
    beside = (sums.roughness(centres, *side) for side in ((-3 * half, -half), (half, 3 * half)))
    rougher = np.maximum(inside[-1] - np.maximum(*beside), 0)
    return np.asarray(_saturate(change.sum(axis=0), 1.0) * (1 + 0.25 * np.tanh(rougher)))


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
        distance = np.abs(columns - (band.right + band.left)[:, None] / 2)
        return np.asarray(distance / ((band.right - band.left)[:, None] / 2))

    def _score(self, planes: Planes, weight: Floats) -> Floats:
        """Evidence per section, half width and centre, shape (rows, halves, centres).

        `weight`, (halves, centres), multiplies it.
        """
        sums = _Sums(planes)
        edges = np.maximum(edge_evidence(planes, 2), edge_evidence(planes, 4))
        near = cv2.dilate(edges, np.ones((1, 3), np.uint8))
        score = np.zeros((self.rows, *weight.shape), dtype=np.float32)
        whole = np.maximum(1, np.rint(self._halves)).astype(int)
        for half in np.unique(whole).tolist():
            alike = whole == half
            counts = weight[alike].max(axis=0)[half + 1 : self.columns - half] > _NEGLIGIBLE
            if counts.any():
                first, last = half + 1 + np.flatnonzero(counts)[[0, -1]]
                at = range(first, last + 1)
                left, right = (near[:, at.start + out : at.stop + out] for out in (-half, half))
                found = _contrast(sums, at, half) * np.sqrt(np.sqrt(left * right))
                score[:, alike, at.start : at.stop] = (
                    found[:, None] * weight[alike, first : last + 1]
                )
        return score


def _trace(score: Floats, halves: Floats, slope: int) -> Band | None:
    """Dynamic programming over the sections with free start and stop.

    A row's states lie flat, their edges padded, so that a move is a shift.
    """
    rows, high, wide = score.shape
    stride = wide + 2 * slope
    padded = np.full((rows, high + 2, stride), -np.inf, dtype=np.float32)
    padded[:, 1:-1, slope : slope + wide] = score - np.float32(_EVIDENT)
    gathered = padded.reshape(rows, -1)
    for before, now in itertools.pairwise(gathered):
        best = np.maximum(before[: -2 * stride], before[2 * stride :]) - np.float32(_WIDEN_COST)
        np.maximum(best, before[stride:-stride], out=best)
        for _ in range(slope):
            moved = np.maximum(best[:-2], best[2:]) - np.float32(_MOVE_COST)
            np.maximum(best[1:-1], moved, out=best[1:-1])
        now[stride:-stride] += np.maximum(best, 0, out=best)
    ends = gathered.argmax(axis=1)
    totals = gathered[np.arange(rows), ends]
    last = int(totals.argmax())
    if totals[last] <= 0:
        return None
    first, states = _walk_back(gathered[: last + 1], int(ends[last]), stride, slope)
    h, c = states // stride - 1, states % stride - slope
    evidence = score[np.arange(first, last + 1), h, c].astype(np.float64)
    half = halves[h].astype(np.float64)
    return Band(first, last, c - half, c + half, evidence, float(totals[last]))


def _walk_back(
    gathered: Floats, end: int, stride: int, slope: int
) -> tuple[int, NDArray[np.int64]]:
    """First row of the sequence that leads to the state `end` of the last, and its states."""
    dc, dh = (move.ravel() for move in np.mgrid[-slope : slope + 1, -1:2])
    cost = (_MOVE_COST * abs(dc) + _WIDEN_COST * abs(dh)).astype(np.float32)
    states = [end]
    for before in gathered[-2::-1]:
        came = states[-1] - dc - stride * dh
        value = before[came] - cost
        best = value.argmax()
        if value[best] <= 0:
            break
        states.append(came[best])
    return len(gathered) - len(states), np.array(states[::-1])
