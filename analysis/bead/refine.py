"""From the toes of the reduced strip to sub-pixel ones in a strip at the photo's own resolution."""

import cv2
import numpy as np
from numpy.typing import NDArray

from .chain import best_chain
from .edge_model import EdgePlaces, locate_edges
from .features import Features, smoothed
from .sampling import Strip
from .toes import Extent
from .width import Toes
from .zones import fisher_direction, zone

Floats = NDArray[np.float64]

_ALONG_PX = 2.0
_ALONG_WIDTHS = 0.03
"""Gaussian averaging along the seam: this many px, or this part of the width if that is more."""


def refine_toes(strip: Strip, extent: Extent, unit: float) -> tuple[Toes, Toes]:
    """Sub-pixel toes of both sides, in offsets."""
    width_px = 2 * float(np.median(extent.half))
    row_px = float(strip.line.s[1] - strip.line.s[0]) / unit
    along = max(_ALONG_PX, _ALONG_WIDTHS * width_px) / row_px
    smooth = smoothed(strip.opponent, 0, along)
    sides = []
    for side, edge in ((-1, extent.left), (1, extent.right)):
        signal, distance = projection(smooth, strip.valid, edge, side, extent)
        near = _sharpest(signal, edge, side, 3 + 0.06 * float(np.median(extent.half)))
        places = locate_edges(signal, near, side)
        sides.append(_toes(strip, places, extent, edge, side, distance))
    return sides[0], sides[1]


def projection(
    opponent: Features, valid: NDArray[np.bool_], edge: Floats, side: int, extent: Extent
) -> tuple[NDArray[np.float32], float]:
    """The one colour mixture that tells bead from plate best at this toe, shape (rows, columns)."""
    depth = max(4.0, 0.25 * float(np.median(extent.half)))
    columns = opponent.shape[1]
    inner = (edge - depth, edge - 1) if side > 0 else (edge + 1, edge + depth)
    outer = (edge + 1, edge + depth) if side > 0 else (edge - depth, edge - 1)
    inside, outside = (zone(columns, *bounds, valid) for bounds in (inner, outer))
    direction, distance = fisher_direction(opponent[inside], opponent[outside])
    return (opponent @ direction.astype(np.float32)), distance


def _sharpest(signal: NDArray[np.float32], edge: Floats, side: int, reach: float) -> Floats:
    """Chain of the steepest falls from bead to plate within `reach` columns of `edge`."""
    smooth = cv2.GaussianBlur(signal, (0, 0), sigmaX=1.5, sigmaY=1.5)
    fall = -side * np.gradient(smooth, axis=1)
    away = side * (np.arange(signal.shape[1]) - edge[:, None])
    typical = np.percentile(np.where(np.abs(away) <= reach, fall, 0).max(axis=1), 50) + 1e-6
    score = np.clip(fall / typical, 0, 1.5) * (1 + 0.2 * away / reach)
    score = np.where(np.abs(away) <= reach, score, -1e6).astype(np.float32)
    return best_chain(score, 0.1).astype(np.float64)


def _toes(
    strip: Strip, places: EdgePlaces, extent: Extent, edge: Floats, side: int, distance: float
) -> Toes:
    column = places.column
    rows = np.arange(len(column))
    reach = 3 + 2 * places.blur_px
    outside = np.clip(np.rint(column + side * reach).astype(int), 0, strip.valid.shape[1] - 1)
    return Toes(
        offset=strip.offset(column),
        u_noise=places.u * strip.step,
        u_model=places.between_models * strip.step,
        height=places.height,
        in_frame=strip.valid[rows, outside],
        present=extent.present,
        disagreement=np.abs(column - edge) * strip.step,
        distance=distance,
        model=places.model,
        blur_px=places.blur_px,
    )
