"""Where the bead lies: found in the photo itself, in either main direction, coarsely."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

from .band import Band, find_band
from .features import Features, reduced_features, smoothed
from .image import Photo
from .plane import Points

_LONGEST_PX = 288
_ALONG = 2
"""Reduced px per section."""


@dataclass(frozen=True, slots=True)
class CoarsePath:
    """A found path: centre points in photo px (n, 2) with the bead's coarse half width in px.

    `evidence` is 0 to 1 per point. `rival` is the evidence of the best other band beside it,
    relative to this one's: near 1 means that two beads (or a bead and its like) are in view.
    """

    centre_px: Points
    half_width_px: NDArray[np.float64]
    evidence: NDArray[np.float64]
    rival: float


def find_path(photo: Photo) -> CoarsePath:
    """The most evident bead-like band in the photo; `EvidenceError` without one."""
    features, factor = reduced_features(photo, _LONGEST_PX)
    found = [_found(features, vertical) for vertical in (False, True)]
    bands = [(band, vertical) for vertical, band in zip((False, True), found, strict=True) if band]
    if not bands:
        raise EvidenceError(
            f"{photo.name}: no band differs from both its sides, so no bead can be told from the "
            "plate; take the photo from above with even light, or give the path by --session"
        )
    band, vertical = max(bands, key=lambda pair: pair[0].total)
    rival = _rival(features, band, vertical)
    return _in_photo(band, vertical, factor, rival)


def _sections(features: Features, vertical: bool) -> Features:
    """Rows that cross the bead: along it smoothed over, and reduced to every `_ALONG`-th."""
    turned = features if vertical else np.swapaxes(features, 0, 1)
    turned = np.ascontiguousarray(turned)
    return smoothed(turned, 0, 2.0)[_ALONG // 2 :: _ALONG]


def _found(
    features: Features, vertical: bool, weight: NDArray[np.float32] | None = None
) -> Band | None:
    sections = _sections(features, vertical)
    widest = 0.6 * sections.shape[1]
    return find_band(sections, 3.0, widest, weight, slope=_ALONG)


def _rival(features: Features, band: Band, vertical: bool) -> float:
    sections = _sections(features, vertical)
    weight = np.ones((sections.shape[0], sections.shape[1] + 1), dtype=np.float32)
    columns = np.arange(sections.shape[1] + 1)
    half = (band.right - band.left) / 2
    middle = (band.right + band.left) / 2
    near = np.abs(columns - middle[:, None]) < 1.6 * half[:, None]
    weight[band.first : band.last + 1][near] = 0
    other = find_band(sections, 3.0, 0.6 * sections.shape[1], weight, slope=_ALONG)
    return other.total / band.total if other else 0.0


def _in_photo(band: Band, vertical: bool, factor: float, rival: float) -> CoarsePath:
    along = (np.arange(band.first, band.last + 1) * _ALONG + _ALONG // 2 + 0.5) * factor - 0.5
    across = (band.left + band.right) / 2 * factor - 0.5
    pair = (across, along) if vertical else (along, across)
    half = (band.right - band.left) / 2 * factor
    return CoarsePath(np.column_stack(pair), half, band.evidence, rival)
