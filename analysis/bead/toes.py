"""Both toes in a strip: per side the chain where the bead's look changes into the plate's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

from .band import edge_evidence
from .chain import best_chain
from .features import Features, robust_scale, smoothed
from .zones import likeness, zone

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


def find_toes(
    features: Features,
    valid: NDArray[np.bool_],
    rough: Extent,
    freedom: float,
    along: float,
    beyond: float,
) -> Extent:
    """Toes near a rough extent: within `freedom` (fraction of the half width) of it.

    Features are averaged over `along` rows (Gaussian sigma). Between a toe and `beyond` half
    widths outside of it nothing counts as plate beforehand.
    """
    smooth = smoothed(features, 0.8, along)
    columns = features.shape[1]
    half = float(np.median(rough.half))
    edges = _edges(smooth)
    bead = zone(
        columns, rough.middle - _CORE * rough.half, rough.middle + _CORE * rough.half, valid
    )
    core = zone(columns, rough.middle - 0.7 * half, rough.middle + 0.7 * half, valid)
    toes, present = [], np.full(len(rough.left), np.inf)
    for side, edge in ((-1, rough.left), (1, rough.right)):
        like = likeness(smooth, bead, _plate(columns, edge, side, half, beyond, valid))
        toes.append(_toe(like, edges, edge, side, half, freedom, valid))
        inside = np.where(core, like, 0).sum(axis=1) / np.maximum(core.sum(axis=1), 1)
        present = np.minimum(present, inside)
    return Extent(toes[0], toes[1], present)


def _plate(
    columns: int, edge: Floats, side: int, half: float, beyond: float, valid: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The plate beside one toe. Nearest to it slag and spatter may belong to either."""
    for reach in (_BESIDE * half + 4, 0.3 * half):
        first = 1 + beyond * half
        bounds = (edge + first, edge + reach) if side > 0 else (edge - reach, edge - first)
        mask = zone(columns, *bounds, valid)
        if mask.sum() >= _ENOUGH:
            return mask
    raise EvidenceError(
        "the plate beside the bead is not in the photo, so its toe cannot be told; "
        "take the photo with plate on both sides"
    )


def _edges(features: Features) -> NDArray[np.float32]:
    """Edge evidence at columns: the mean of the two column edges around each."""
    scaled = (features / robust_scale(features)).astype(np.float32)
    at_edges = np.maximum(edge_evidence(scaled, 2), edge_evidence(scaled, 5))
    return np.asarray(0.5 * (at_edges[:, :-1] + at_edges[:, 1:]), dtype=np.float32)


def _toe(
    like: NDArray[np.float32],
    edges: NDArray[np.float32],
    rough: Floats,
    side: int,
    half: float,
    freedom: float,
    valid: NDArray[np.bool_],
) -> Floats:
    """Chain that splits bead-like from plate-like places and lies on sharp edges."""
    columns = like.shape[1]
    gathered = np.cumsum(np.where(valid, like, 0), axis=1)
    region = side * gathered / max(4.0, 0.12 * half)
    beyond = side * (np.arange(columns) - rough[:, None])
    reach = freedom * half + 2
    score = (region + _EDGE * edges).astype(np.float32)
    score = np.where(np.abs(beyond) <= reach, score, np.float32(-1e6))
    return best_chain(score - score.max(axis=1, keepdims=True), _MOVE).astype(np.float64)
