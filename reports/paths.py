"""Curves as SVG paths of few points that look like all of them.

Each pixel column keeps its first, lowest, highest and last value (M4), so no spike is lost.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .axes import Scale

_POINTS_PER_CURVE = 1600
_MOST_RUNS = 200
"""Pieces between gaps that are drawn as curves; with more, each pixel column shows its extent."""
_WIDEST_PX = 2000


def _runs(y: NDArray[Any]) -> list[tuple[int, int]]:
    """Half-open index ranges without gaps."""
    known = np.concatenate(([False], np.isfinite(y), [False]))
    turns = np.flatnonzero(np.diff(known.astype(np.int8)))
    return [(int(a), int(b)) for a, b in turns.reshape(-1, 2)]


def _thin(x: NDArray[Any], y: NDArray[Any], points: int) -> NDArray[np.intp]:
    """Indices of the points that a drawing of `points` needs (M4 per pixel column)."""
    if y.size <= points:
        return np.arange(y.size)
    from tsdownsample import M4Downsampler

    wide = np.ascontiguousarray(y, dtype=np.float64)
    thin: Any = M4Downsampler
    kept = thin().downsample(np.ascontiguousarray(x, np.float64), wide, n_out=points)
    indices: NDArray[np.intp] = np.unique(kept.astype(np.intp))
    return indices


def _points(x: NDArray[Any], y: NDArray[Any]) -> str:
    return " ".join(f"{a:.1f} {b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))


def curve_path(x: NDArray[Any], y: NDArray[Any], across: Scale, up: Scale, step: bool) -> str:
    """The line through the known values; gaps stay open."""
    runs = _runs(y)
    if len(runs) > _MOST_RUNS:
        return _extents(across.px(x), up.px(y), up.px(y))
    total = max(sum(b - a for a, b in runs), 1)
    pieces = []
    for a, b in runs:
        share = max(4 * (_POINTS_PER_CURVE * (b - a) // total // 4), 8)
        kept = a + _thin(x[a:b], y[a:b], share)
        pieces.append(_piece(across.px(x[kept]), up.px(y[kept]), step))
    return "".join(pieces)


def _extents(x: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> str:
    """Per pixel column a bar from the lowest to the highest known value; none where none is."""
    known = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
    column = np.rint(x[known]).astype(int)
    top = np.full(_WIDEST_PX + 1, np.inf)
    bottom = np.full(_WIDEST_PX + 1, -np.inf)
    np.minimum.at(top, column, np.minimum(low, high)[known])
    np.maximum.at(bottom, column, np.maximum(low, high)[known])
    return "".join(
        f"M{i} {top[i] - 0.5:.1f}h1V{bottom[i] + 0.5:.1f}h-1Z"
        for i in np.flatnonzero(np.isfinite(top)).tolist()
    )


def _piece(x: NDArray[Any], y: NDArray[Any], step: bool) -> str:
    if x.size == 1:
        return f"M{x[0] - 1:.1f} {y[0]:.1f}h2"
    if step:
        x, y = np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]
    return "M" + _points(x, y)


def area_path(
    x: NDArray[Any], low: NDArray[Any], high: NDArray[Any], across: Scale, up: Scale
) -> str:
    """The area between two edges, where both are known."""
    runs = _runs(np.where(np.isfinite(low) & np.isfinite(high), low, np.nan))
    if len(runs) > _MOST_RUNS:
        return _extents(across.px(x), up.px(low), up.px(high))
    half = _POINTS_PER_CURVE // 2
    pieces = []
    for a, b in runs:
        below, above = (a + _thin(x[a:b], edge[a:b], half) for edge in (low, high))
        there = _points(across.px(x[above]), up.px(high[above]))
        back = _points(across.px(x[below][::-1]), up.px(low[below][::-1]))
        pieces.append(f"M{there} {back}Z")
    return "".join(pieces)
