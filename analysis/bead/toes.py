"""Both toes in a strip: per side the chain where the bead's look changes into the plate's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

from .band import edge_evidence
from .chain import best_chain
from .features import Features, robust_scale, smoothed
from .zones import Look, bead_likeness, look_of, zone

Floats = NDArray[np.float64]

_EDGE = 1.2
"""Weight of a sharp edge against the evidence of the zones' looks."""
_ENOUGH = 64
_OUTWARD = 0.1
"""Share by which an edge counts more at the outermost allowed place than at the innermost."""


@dataclass(frozen=True, slots=True)
class Extent:
    """Columns of the toes per row; `likeness` (rows, columns) bead against plate, right and left.

    `present` is the mean likeness of the inside, per row: below 0 it looks like plate.
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
    features: Features, valid: NDArray[np.bool_], rough: Extent, freedom: float
) -> Extent:
    """Toes near a rough extent: within `freedom` (fraction of the half width) of it."""
    smooth = smoothed(features, 0.8, 2.0)
    columns = features.shape[1]
    half = float(np.median(rough.half))
    edges = _edges(smooth)
    likeness = bead_likeness(
        smooth, _bead_looks(smooth, rough, half, valid), _plate_looks(smooth, rough, half, valid)
    )
    left = _toe(likeness, edges, rough.left, -1, half, freedom, valid)
    right = _toe(likeness, edges, rough.right, 1, half, freedom, valid)
    core = zone(columns, rough.middle - 0.7 * half, rough.middle + 0.7 * half, valid)
    present = np.where(core, likeness, 0).sum(axis=1) / np.maximum(core.sum(axis=1), 1)
    return Extent(left, right, present.astype(np.float64))


def _bead_looks(
    features: Features, rough: Extent, half: float, valid: NDArray[np.bool_]
) -> list[Look]:
    """Looks of the bead's core and of its two flanks."""
    parts = ((-0.75, -0.3), (-0.4, 0.4), (0.3, 0.75))
    masks = [
        zone(features.shape[1], rough.middle + a * half, rough.middle + b * half, valid)
        for a, b in parts
    ]
    return [_look(features, mask) for mask in masks]


def _plate_looks(
    features: Features, rough: Extent, half: float, valid: NDArray[np.bool_]
) -> list[Look]:
    """Looks of the plate near and farther, on both sides; a toe may meet any of them."""
    looks = []
    for side, edge in ((-1, rough.left), (1, rough.right)):
        near = _outside(features.shape[1], edge, side, 0.12 * half + 2, 0.5 * half + 8, valid)
        looks.append(_look(features, near))
        far = _outside(features.shape[1], edge, side, 0.5 * half, 1.2 * half + 8, valid)
        if far.sum() >= _ENOUGH:
            looks.append(_look(features, far))
    return looks


def _look(features: Features, mask: NDArray[np.bool_]) -> Look:
    samples = features[mask]
    if len(samples) < _ENOUGH:
        raise EvidenceError(
            "the plate beside the bead is not in the photo, so its toe cannot be told; "
            "take the photo with plate on both sides"
        )
    return look_of(samples[:: max(1, len(samples) // 40_000)])


def _outside(
    columns: int, edge: Floats, side: int, near: float, far: float, valid: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    bounds = (edge + near, edge + far) if side > 0 else (edge - far, edge - near)
    mask = zone(columns, *bounds, valid)
    if mask.sum() >= _ENOUGH:
        return mask
    bounds = (edge + 1, edge + far) if side > 0 else (edge - far, edge - 1)
    return zone(columns, *bounds, valid)


def _edges(features: Features) -> NDArray[np.float32]:
    """Edge evidence at columns: the mean of the two column edges around each."""
    scaled = (features / robust_scale(features)).astype(np.float32)
    at_edges = np.maximum(edge_evidence(scaled, 2), edge_evidence(scaled, 5))
    return np.asarray(0.5 * (at_edges[:, :-1] + at_edges[:, 1:]), dtype=np.float32)


def _toe(
    likeness: NDArray[np.float32],
    edges: NDArray[np.float32],
    rough: Floats,
    side: int,
    half: float,
    freedom: float,
    valid: NDArray[np.bool_],
) -> Floats:
    """Chain that splits bead-like from plate-like places and lies on sharp edges."""
    columns = likeness.shape[1]
    gathered = np.cumsum(np.where(valid, likeness, 0), axis=1)
    region = side * gathered / max(4.0, 0.12 * half)
    beyond = side * (np.arange(columns) - rough[:, None])
    reach = freedom * half + 2
    outward = 1 + _OUTWARD * np.clip(beyond / reach, -1, 1)
    score = (region + _EDGE * edges * outward).astype(np.float32)
    score = np.where(np.abs(beyond) <= reach, score, np.float32(-1e6))
    return best_chain(score - score.max(axis=1, keepdims=True), 0.15).astype(np.float64)
