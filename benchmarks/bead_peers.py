"""Peers that measure a bead's width, and how any of them is scored.

Each gives places along the seam and widths, mm. Where a peer needs to know the seam it is told
the true one, which it would not know in use.
"""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.bead.plane import Plane
from seamlog.analysis.bead.synthetic import SyntheticBead

Floats = NDArray[np.float64]
Widths = tuple[Floats, Floats]
Peer = Callable[[SyntheticBead, Plane], Widths]

_STATION_MM = 0.25
_LOST_MM = 0.5
_NEAR_MM = 1.2
"""How far from 3 mm a detected edge may lie to be taken for a toe."""


def mask_of(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The largest region brighter than Otsu's threshold, smoothed."""
    mask = cv2.threshold(cv2.GaussianBlur(pixels, (5, 5), 0), 0, 255, cv2.THRESH_OTSU)[1]
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    mask = np.where(labels == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA]), 255, 0).astype(np.uint8)
    spot = np.ones((9, 9), np.uint8)
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, spot)
    return np.asarray(cv2.morphologyEx(closed, cv2.MORPH_OPEN, spot), dtype=np.uint8)


def skeleton(bead: SyntheticBead, plane: Plane) -> Widths:
    """Twice the distance transform on the skeleton of the mask."""
    from skimage.morphology import skeletonize

    mask = mask_of(bead.pixels)
    distance = cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    y, x = np.nonzero(skeletonize(mask > 0))
    points = np.column_stack([x, y]).astype(np.float64)
    scale = plane.unit_per_px(points)
    return bead.seam_s_mm(plane.to_plane(points)), 2.0 * scale * distance[y, x]


def canny(bead: SyntheticBead, plane: Plane) -> Widths:
    """Outermost Canny edges of each column near the seam, times the cosine of its slope."""
    edges = cv2.Canny(cv2.GaussianBlur(bead.pixels, (5, 5), 1.6), 13, 40) > 0
    seam = plane.to_px(np.column_stack([bead.x_mm, bead.y_mm]))
    columns = np.arange(edges.shape[1])
    middle = np.interp(columns, seam[:, 0], seam[:, 1])
    reach = 4.8 / plane.unit_per_px(seam)
    edges &= np.abs(np.arange(len(edges))[:, None] - middle) < reach
    seen = columns[edges.sum(axis=0) >= 2]
    top = np.argmax(edges, axis=0)[seen]
    bottom = len(edges) - 1 - np.argmax(edges[::-1], axis=0)[seen]
    a, b = (plane.to_plane(np.column_stack([seen, row]).astype(float)) for row in (top, bottom))
    s = bead.seam_s_mm((a + b) / 2)
    slope = np.interp(s, bead.s_mm, np.gradient(bead.y_mm, bead.x_mm))
    return s, np.hypot(*(b - a).T) / np.hypot(1.0, slope)


def subpixel(bead: SyntheticBead, plane: Plane) -> Widths:
    """Edge points of `subpixel-edges`, the median of those near 3 mm at each station and side."""
    points = subpixel_points(bead.pixels)
    s, offset = _along_and_across(bead, plane.to_plane(points))
    at = np.floor(s / _STATION_MM).astype(np.int64)
    near = np.abs(np.abs(offset) - 3.0) < _NEAR_MM
    stations, widths = [], []
    for station in np.unique(at[near]):
        here = near & (at == station)
        left, right = -offset[here & (offset < 0)], offset[here & (offset > 0)]
        if len(left) and len(right):
            stations.append((station + 0.5) * _STATION_MM)
            widths.append(float(np.median(left) + np.median(right)))
    return np.array(stations), np.array(widths)


def subpixel_points(pixels: NDArray[np.uint8]) -> Floats:
    """Edge points, shape (n, 2) px. The package names a type that numpy no longer has."""
    np.__dict__.setdefault("int", int)
    from subpixel_edges import subpixel_edges

    found = subpixel_edges(pixels.astype(np.float64), 12, 2, 2)
    return np.column_stack([found.x, found.y])


def profile_lines(bead: SyntheticBead, plane: Plane) -> Widths:
    """scikit-image's `profile_line` across the seam, five px broad, and its steepest changes."""
    from scipy.ndimage import gaussian_filter1d
    from skimage.measure import profile_line

    pixels = bead.pixels.astype(np.float64)
    stations = np.arange(3.0, 99.4, _STATION_MM)
    x, y = (np.interp(stations, bead.s_mm, values) for values in (bead.x_mm, bead.y_mm))
    slope = np.interp(stations, bead.s_mm, np.gradient(bead.y_mm, bead.x_mm))
    across = np.column_stack([-slope, np.ones_like(slope)]) / np.hypot(1.0, slope)[:, None]
    middle = np.column_stack([x, y])
    first, last = (plane.to_px(middle + sign * 6.0 * across)[:, ::-1] for sign in (-1, 1))
    widths = []
    for a, b in zip(first, last, strict=True):
        values = profile_line(pixels, a, b, linewidth=5, order=1, mode="nearest")
        rise = np.abs(np.gradient(gaussian_filter1d(values, 2.0)))
        half = len(rise) // 2
        left = _peak(rise[: half - 8])
        right = half + 8 + _peak(rise[half + 8 :])
        widths.append((right - left) / (len(rise) - 1) * 12.0)
    return stations, np.array(widths)


def _peak(values: Floats) -> float:
    at = int(np.clip(np.argmax(values), 1, len(values) - 2))
    a, b, c = values[at - 1 : at + 2]
    curvature = a - 2 * b + c
    return at + (0.5 * (a - c) / curvature if abs(curvature) > 1e-9 else 0.0)


def _along_and_across(bead: SyntheticBead, points: Floats) -> tuple[Floats, Floats]:
    s = bead.seam_s_mm(points)
    x, y = (np.interp(s, bead.s_mm, values) for values in (bead.x_mm, bead.y_mm))
    side = np.sign(points[:, 1] - y)
    return s, side * np.hypot(points[:, 0] - x, points[:, 1] - y)


def score(bead: SyntheticBead, measured: Widths, px_mm: float = 0.1) -> tuple[Floats, float]:
    """Errors of the kept stations in px, and the part of the stations that is lost."""
    s, width = measured
    error = width - bead.width_at_mm(s)
    at = np.floor((s - 3.0) / _STATION_MM).astype(np.int64)
    count = round((99.4 - 3.0) / _STATION_MM)
    errors = np.full(count, np.nan)
    for station in range(count):
        here = error[(at == station) & np.isfinite(error)]
        if len(here):
            errors[station] = np.median(here)
    kept = np.abs(errors) <= _LOST_MM
    return errors[kept] / px_mm, 1.0 - float(kept.mean())


PEERS: dict[str, Peer] = {
    "skeleton + distance transform": skeleton,
    "Canny x cos": canny,
    "subpixel-edges": subpixel,
    "profile_line": profile_lines,
}
