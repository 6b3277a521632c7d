"""Where the bead lies: found in the photo itself, in either main direction, coarsely."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

from .band import Band, BandSearch, relative
from .features import Features, reduced_features, smoothed
from .image import Photo
from .plane import Points

_LONGEST_PX = 288
NESTED = 0.7
"""Relative evidence from which on a band inside the found one may be the bead itself."""
_ALIKE = 0.9
"""Relative evidence from which on a band beside the found one may be the bead instead."""
_ALONG = 2
"""Reduced px per section."""


@dataclass(frozen=True, slots=True)
class CoarsePath:
    """A found path: centre points in photo px (n, 2) with the bead's coarse half width in px.

    `evidence` is 0 to 1 per point. `rival` is the evidence of the best other band beside it,
    relative to this one's: near 1 means that two beads (or a bead and its like) are in view;
    `inner` the same for a narrower band inside it; `nested`: it lies inside a more evident one.
    """

    centre_px: Points
    half_width_px: NDArray[np.float64]
    evidence: NDArray[np.float64]
    rival: float
    inner: float
    nested: bool


def find_paths(photo: Photo) -> list[CoarsePath]:
    """The most evident bead-like band in the photo, then others that may be the bead instead.

    A heat tint is the most evident band of some photos, the bead lies inside; and a shadow along
    a toe may look as much like a bead as the bead beside it. `EvidenceError` without any band.
    """
    features, factor = reduced_features(photo, _LONGEST_PX)
    searches = [_search(features, vertical) for vertical in (False, True)]
    bands = [search.best() for search in searches]
    band, vertical = max(
        ((band, bool(turn)) for turn, band in enumerate(bands) if band),
        key=lambda pair: pair[0].total,
        default=(None, False),
    )
    if band is None:
        raise EvidenceError(
            f"{photo.name}: no band differs from both its sides, so no bead can be told from the "
            "plate; take the photo from above with even light, or give the path by --session"
        )
    search = searches[vertical]
    inside = search.inside(band)
    beside = search.beside(band)
    rival, inner = relative(beside, band), relative(inside, band)
    found = [_in_photo(band, vertical, factor, rival, inner)]
    if inside is not None and inner >= NESTED:
        deeper = relative(search.inside(inside), inside)
        found.append(_in_photo(inside, vertical, factor, rival, deeper, nested=True))
    if beside is not None and rival >= _ALIKE:
        deeper = relative(search.inside(beside), beside)
        found.append(_in_photo(beside, vertical, factor, rival, deeper))
    return found


def _search(features: Features, vertical: bool) -> BandSearch:
    """Sections that cross the bead: smoothed along it, and every `_ALONG`-th of them."""
    turned = features if vertical else np.swapaxes(features, 0, 1)
    sections = smoothed(np.ascontiguousarray(turned), 0, 2.0)[_ALONG // 2 :: _ALONG]
    return BandSearch(sections, 3.0, 0.6 * sections.shape[1], slope=_ALONG)


def _in_photo(
    band: Band, vertical: bool, factor: float, rival: float, inner: float, nested: bool = False
) -> CoarsePath:
    along = (np.arange(band.first, band.last + 1) * _ALONG + _ALONG // 2 + 0.5) * factor - 0.5
    across = (band.left + band.right) / 2 * factor - 0.5
    pair = (across, along) if vertical else (along, across)
    half = (band.right - band.left) / 2 * factor
    return CoarsePath(np.column_stack(pair), half, band.evidence, rival, inner, nested)
