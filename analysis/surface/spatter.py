"""Spatter beside the bead: where it lies, how large, how far from the toe, and what is new.

Without a photo from before welding every drop-like mark of the plate counts; with one those that
were there before are left out.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from seamlog.analysis.bead.image import Photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.overlap import match_photos
from seamlog.analysis.bead.plane import Plane, Points
from seamlog.errors import EvidenceError

from .blobs import Blobs, Grid, find_blobs

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

SMALLEST_MM, LARGEST_MM = 0.3, 3.0
"""Diameters that count as spatter."""
_SMALLEST, _LARGEST = 0.024, 0.24
"""The same as parts of the bead's width, where there are no millimetres."""
_LEAST_PX = 1.5
REACH = 4.0
"""How far from the bead spatter is looked for, in bead widths."""
_MARGIN = 0.03
_SHOWN = 0.9
"""Part of the photo that the one from before must show."""
_SAME = 0.5
"""Part of a blob's contrast that a mark has on the photo from before if it was there already."""


@dataclass(frozen=True, slots=True)
class Spatter:
    """Drops beside the bead, arrays of one length; lengths in `unit` (mm, or px uncalibrated).

    `s` is the arc length of the nearest station, `distance` that to the nearest toe. `smallest` is
    the least diameter that the photo could show; `known_before` counts marks left out because they
    were there before welding, None without a photo from before.
    """

    blobs: Blobs
    s: Floats
    distance: Floats
    diameter: Floats
    unit: str
    smallest: float
    reach: float
    known_before: int | None

    @property
    def area(self) -> Floats:
        """Area of each drop, unit squared."""
        return np.asarray(np.pi * self.diameter**2 / 4)


def find_spatter(
    photo: Photo, plane: Plane, bead: BeadMeasurement, before: Photo | None = None
) -> Spatter:
    """Spatter on the plate; `EvidenceError` where the photo from before does not fit this one."""
    earlier = None if before is None else _registered(photo, before)
    width_px = float(np.nanmedian(bead.width)) / bead.unit_per_px
    low, high = _radii_px(bead, width_px)
    plate = plate_mask(photo, bead, width_px)
    light = np.ascontiguousarray(photo.opponent()[..., 0])
    blobs = find_blobs(light, plate, low, high)
    known = None
    if earlier is not None:
        fresh = ~_were_there(blobs, earlier)
        known = int((~fresh).sum())
        blobs = blobs.chosen(fresh)
    places = np.column_stack([blobs.x_px, blobs.y_px])
    s, distance = _from_toe(places, plane, bead)
    unit = _unit_at(places, plane)
    return Spatter(
        blobs,
        s,
        np.maximum(distance - blobs.radius_px * unit, 0.0),
        2 * blobs.radius_px * unit,
        bead.unit,
        2 * low * bead.unit_per_px,
        REACH * float(np.nanmedian(bead.width)),
        known,
    )


def _radii_px(bead: BeadMeasurement, width_px: float) -> tuple[float, float]:
    if bead.unit == "mm":
        low, high = (d / 2 / bead.unit_per_px for d in (SMALLEST_MM, LARGEST_MM))
    else:
        low, high = (part * width_px / 2 for part in (_SMALLEST, _LARGEST))
    return max(low, _LEAST_PX), max(high, 2 * _LEAST_PX)


def bead_mask(photo: Photo, bead: BeadMeasurement) -> Mask:
    """Pixels between the toes."""
    seen = np.isfinite(bead.left_px).all(axis=1) & np.isfinite(bead.right_px).all(axis=1)
    outline = np.concatenate([bead.left_px[seen], bead.right_px[seen][::-1]])
    mask = np.zeros((photo.height_px, photo.width_px), np.uint8)
    cv2.fillPoly(mask, [np.rint(outline).astype(np.int32)], 1)
    return np.asarray(mask > 0)


def plate_mask(photo: Photo, bead: BeadMeasurement, width_px: float) -> Mask:
    """Pixels of the plate near the bead: beside the toes, not further than `REACH` widths."""
    outside = np.asarray(1 - bead_mask(photo, bead).astype(np.uint8))
    away = cv2.distanceTransform(outside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    margin = max(2.5, _MARGIN * width_px)
    return np.asarray((away > margin) & (away < REACH * width_px))


def _from_toe(places: Points, plane: Plane, bead: BeadMeasurement) -> tuple[Floats, Floats]:
    """Arc length of the nearest station and distance to the nearest toe."""
    if not len(places):
        return np.empty(0), np.empty(0)
    at = plane.to_plane(places)
    count = len(bead.s)
    toes = plane.to_plane(np.concatenate([bead.left_px, bead.right_px]))
    seen = np.flatnonzero(np.isfinite(toes).all(axis=1))
    distance, nearest = cKDTree(toes[seen]).query(at)
    return np.asarray(bead.s[seen[nearest] % count]), np.asarray(distance)


def _unit_at(places: Points, plane: Plane) -> Floats:
    """Length of a pixel at each place."""
    if not len(places):
        return np.empty(0)
    steps = [plane.to_plane(places + half) - plane.to_plane(places - half) for half in _HALVES]
    (right, down) = steps
    return np.asarray(np.sqrt(np.abs(right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0])))


_HALVES = (np.array([0.5, 0.0]), np.array([0.0, 0.5]))


def _were_there(blobs: Blobs, earlier: Grid) -> Mask:
    """Which blobs have their like on the photo from before, brought over this one."""
    found = np.zeros(len(blobs), dtype=bool)
    for index in range(len(blobs)):
        x, y, radius = blobs.x_px[index], blobs.y_px[index], blobs.radius_px[index]
        contrast = _contrast(earlier, x, y, radius)
        found[index] = contrast * np.sign(blobs.contrast[index]) > _SAME * abs(
            blobs.contrast[index]
        )
    return found


def _contrast(light: Grid, x: float, y: float, radius: float) -> float:
    reach = int(np.ceil(2.6 * radius)) + 1
    side = 2 * reach + 1
    patch = cv2.getRectSubPix(light, (side, side), (float(x), float(y)))
    away = np.hypot(*(np.indices(patch.shape) - reach))
    ring = (away > 1.6 * radius) & (away < 2.6 * radius)
    return float(np.mean(patch[away <= max(0.5 * radius, 1.0)]) - np.median(patch[ring]))


def _registered(photo: Photo, before: Photo) -> Grid:
    """Lightness of the photo from before, over this one: by marks that both show."""
    matrix = match_photos(before, photo)
    if matrix is None:
        raise EvidenceError(
            f"{before.name} cannot be laid over {photo.name}: they share too few marks; take both "
            "from the same place"
        )
    earlier = np.ascontiguousarray(before.opponent()[..., 0])
    size = (photo.width_px, photo.height_px)
    shown = float(cv2.warpPerspective(np.ones_like(earlier), matrix, size).mean())
    if shown < _SHOWN:
        raise EvidenceError(
            f"{before.name} shows {100 * shown:.0f} % of {photo.name} only: marks from before "
            "welding cannot be told from spatter on the rest"
        )
    return np.asarray(cv2.warpPerspective(earlier, matrix, size, borderMode=cv2.BORDER_REPLICATE))
