"""Both toes in a strip: per side the chain where the bead's look changes into the plate's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

from . import loops
from .band import edge_evidence
from .chain import best_chains
from .features import Features, Planes, in_spreads, planes_of, smoothed
from .loops import loaded
from .series import median
from .zones import Looks, Shares, Zone, looks_of

Floats = NDArray[np.float64]

_EDGE = 0.6
"""Weight of a sharp edge against the evidence of the zones' looks."""
_ENOUGH = 64
_CORE = 0.85
"""Part of the half width that shows how the bead looks."""
_BESIDE = 0.8
"""Half widths of plate, from the toe, that show how it looks."""
_MOVE = 0.4


@dataclass(frozen=True, slots=True)
class Extent:
    """Columns of the toes per row.

    `present` is the mean likeness of the inside, bead against plate, per row: below 0 it looks
    like plate.
    """

    left: Floats
    right: Floats
    present: Floats

    @property
    def middle(self) -> Floats:
        """Column of the bead's middle."""
        return (self.left + self.right) / 2

    @property
    def half(self) -> Floats:
        """Half width in columns."""
        return (self.right - self.left) / 2


@dataclass(frozen=True, slots=True)
class StripLook:
    """How a strip looks, averaged along it, what of it is in the photo, its edges."""

    looks: Looks
    valid: NDArray[np.bool_]
    edges: NDArray[np.float32]


def strip_look(features: Features, valid: NDArray[np.bool_], along: float) -> StripLook:
    """The look of a strip, averaged over `along` rows (Gaussian sigma)."""
    planes = planes_of(smoothed(features, 0.8, along))
    return StripLook(looks_of(planes), valid, _edges(in_spreads(planes)))


def find_toes(look: StripLook, rough: Extent, freedom: float, beyond: float) -> Extent:
    """Toes near a rough extent: within `freedom` (fraction of the half width) of it.

    Between a toe and `beyond` half widths outside of it nothing counts as plate beforehand.
    """
    valid, columns = look.valid, look.valid.shape[1]
    half = median(rough.half)
    inside = Zone.between(
        rough.middle - _CORE * rough.half, rough.middle + _CORE * rough.half, valid
    )
    bead = look.looks.shares(inside)
    core = Zone.between(rough.middle - 0.7 * half, rough.middle + 0.7 * half, valid).mask()
    reach = freedom * half + 2
    windows = _windows(columns, rough, reach)
    score = loaded(loops.scored) or _score
    scores, present = [], np.full(len(rough.left), np.inf)
    for side, edge, window in zip((-1, 1), (rough.left, rough.right), windows, strict=True):
        plate = _plate(look, edge, side, half, beyond)
        like = look.looks.likeness(bead, plate).reshape(valid.shape)
        like *= valid
        gain = np.float32(side / max(4.0, 0.12 * half))
        where = window.start, window.stop - window.start, reach
        scores.append(score(like, look.edges, edge, *where, gain, np.float32(_EDGE)))
        present = np.minimum(present, (core * like).sum(axis=1))
    left, right = best_chains(np.stack(scores), _MOVE).astype(np.float64)
    present /= np.maximum(np.count_nonzero(core, axis=1), 1)
    return Extent(left + windows[0].start, right + windows[1].start, present)


def _windows(columns: int, rough: Extent, reach: float) -> list[slice]:
    """Columns within `reach` of the left and of the right edge, as many for both."""
    edges = (rough.left, rough.right)
    size = min(columns, int(max(np.ptp(edge) for edge in edges) + 2 * reach) + 2)
    lowest = (int(np.floor(edge.min() - reach)) for edge in edges)
    firsts = [min(max(first, 0), columns - size) for first in lowest]
    return [slice(first, first + size) for first in firsts]


def _plate(look: StripLook, edge: Floats, side: int, half: float, beyond: float) -> Shares:
    """The looks of the plate beside one toe.

    Nearest to it slag and spatter may belong to either, so that part counts only where the photo
    holds no other plate.
    """
    reach = _BESIDE * half + 4
    for first in (1 + beyond * half, 1.0):
        bounds = (edge + first, edge + reach) if side > 0 else (edge - reach, edge - first)
        plate = look.looks.shares(Zone.between(*bounds, look.valid))
        if plate.places >= _ENOUGH:
            return plate
    raise EvidenceError(
        "the plate beside the bead is not in the photo, so its toe cannot be told; "
        "take the photo with plate on both sides"
    )


def _edges(planes: Planes) -> NDArray[np.float32]:
    """Edge evidence at columns: the mean of the two column edges around each."""
    at_edges = np.maximum(edge_evidence(planes, 2), edge_evidence(planes, 5))
    return np.asarray(0.5 * (at_edges[:, :-1] + at_edges[:, 1:]), dtype=np.float32)


def _score(
    like: NDArray[np.float32],
    edges: NDArray[np.float32],
    toe: Floats,
    start: int,
    columns: int,
    reach: float,
    gain: np.float32,
    weight: np.float32,
) -> NDArray[np.float32]:
    """How well a toe at each of `columns` from `start` on splits bead-like from plate-like places.

    And how sharp it is there; farther than `reach` from `toe` there is none.
    """
    at = np.arange(start, start + columns)
    score = np.cumsum(like[:, at[0] : at[-1] + 1], axis=1)
    score *= gain
    score += weight * edges[:, at[0] : at[-1] + 1]
    score = np.where(np.abs(at - toe[:, None]) <= reach, score, np.float32(-1e6))
    return np.asarray(score - score.max(axis=1, keepdims=True))
