"""Places of a bead that a person should look at: pores, cracks, undercut. Never verdicts.

From above a pore is a dark closed blob in the bead, a crack a thin dark line in it, undercut a
stretch of toe with a broader shadow than elsewhere. Slag, ripples and scratches look alike.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from seamlog.analysis.bead.image import Photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane

from .blobs import Grid, find_blobs
from .cracks import find_cracks
from .straightened import StraightBead, straightened

Floats = NDArray[np.float64]

MOST = 6
"""Candidates of one kind that are shown, the most striking first."""
_PORE_SCORE = 7.0
_PORE = (0.03, 0.2)
_UNDERCUT_LENGTH = 0.5
_SHADOW, _PLATE = (0.02, 0.12), (0.3, 0.6)
"""Where undercut lies and where the plate is looked at, in widths outside a toe."""
_ALONG = 0.08
"""Widths along a toe (Gaussian sigma) over which its shadow is averaged."""
_TILE_PX = 160


@dataclass(frozen=True, slots=True)
class Candidate:
    """A place to look at: `kind`, place in the photo and along the bead, how striking it is."""

    kind: str
    x_px: float
    y_px: float
    s: float
    score: float


def find_candidates(photo: Photo, plane: Plane, bead: BeadMeasurement) -> list[Candidate]:
    """Candidates of each kind, the most striking first."""
    light = np.ascontiguousarray(photo.opponent()[..., 0])
    found = _undercut(light, plane, bead)
    straight = straightened(photo, plane, bead)
    if straight is not None:
        found = [*_pores(straight), *_cracks(straight), *found]
    return [_placed(bead, *item) for item in found]


def _placed(bead: BeadMeasurement, kind: str, x: float, y: float, score: float) -> Candidate:
    nearest = int(np.argmin(np.hypot(*(bead.centre_px - (x, y)).T)))
    return Candidate(kind, x, y, float(bead.s[nearest]), score)


_Found = list[tuple[str, float, float, float]]


def _best(found: _Found) -> _Found:
    return sorted(found, key=lambda item: -item[3])[:MOST]


def _pores(straight: StraightBead) -> _Found:
    low, high = (max(1.5, part * straight.width / 2) for part in _PORE)
    blobs = find_blobs(straight.light, straight.inside, low, high)
    chosen = blobs.chosen((blobs.contrast < 0) & (blobs.score > _PORE_SCORE))
    rows = zip(chosen.y_px, chosen.x_px, chosen.score, strict=True)
    return _best(
        [("pore", *straight.to_px(row, column), float(score)) for row, column, score in rows]
    )


def _cracks(straight: StraightBead) -> _Found:
    return _best(
        [("crack", *straight.to_px(row, column), score)
         for row, column, score in find_cracks(straight)]
    )  # fmt: skip


def _undercut(light: Grid, plane: Plane, bead: BeadMeasurement) -> _Found:
    """Stretches of a toe whose shadow is darker and broader than along the rest of it."""
    usual = float(np.nanmedian(bead.width))
    found: _Found = []
    for toe in (bead.left_px, bead.right_px):
        outwards = plane.to_plane(toe) - plane.to_plane(bead.centre_px)
        outwards /= np.maximum(np.hypot(*outwards.T), 1e-9)[:, None]
        shadow, plate = (
            _beside(light, plane, toe, outwards, np.array(zone) * usual)
            for zone in (_SHADOW, _PLATE)
        )
        found += _dark_runs(plate - shadow, toe, bead, usual)
    return _best(found)


def _beside(light: Grid, plane: Plane, toe: Floats, outwards: Floats, zone: Floats) -> Floats:
    """Mean lightness from `zone[0]` to `zone[1]` outside each station's toe."""
    away = np.linspace(zone[0], zone[1], 8)
    places = plane.to_plane(toe)[:, None] + away[None, :, None] * outwards[:, None]
    px = plane.to_px(places.reshape(-1, 2)).reshape(*places.shape)
    at = np.nan_to_num(px, nan=-1.0).astype(np.float32)
    sampled = cv2.remap(
        light, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(sampled.mean(axis=1), dtype=np.float64)


def _dark_runs(depth: Floats, toe: Floats, bead: BeadMeasurement, usual: float) -> _Found:
    good = bead.good
    if good.sum() < 10:
        return []
    station = float(bead.s[-1] - bead.s[0]) / (len(bead.s) - 1)
    depth = gaussian_filter1d(depth, _ALONG * usual / station, mode="nearest")
    middle = float(np.median(depth[good]))
    spread = 1.4826 * float(np.median(np.abs(depth[good] - middle))) + 1.0
    dark = good & (depth > middle + 3 * spread) & (depth > 0)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], dark.astype(np.int8), [0]])))
    found: _Found = []
    for first, stop in edges.reshape(-1, 2):
        if bead.s[stop - 1] - bead.s[first] >= _UNDERCUT_LENGTH * usual:
            at = int(first + np.argmax(depth[first:stop]))
            x, y = (float(value) for value in toe[at])
            found.append(("undercut", x, y, float((depth[at] - middle) / spread)))
    return found


def contact_sheet(photo: Photo, candidates: list[Candidate], reach_px: float) -> NDArray[np.uint8]:
    """Numbered crops of all candidates, `2 reach_px` wide, black beside the photo; uint8 BGR."""
    reach = int(reach_px)
    side, frame = 2 * reach + 1, (reach + 1,) * 4
    picture = cv2.copyMakeBorder(photo.as_bgr8(), *frame, cv2.BORDER_CONSTANT)
    tiles = []
    for number, item in enumerate(candidates, 1):
        middle = (item.x_px + reach + 1, item.y_px + reach + 1)
        crop = cv2.getRectSubPix(picture, (side, side), middle)
        tile = cv2.resize(crop, (_TILE_PX, _TILE_PX), interpolation=cv2.INTER_AREA)
        text = f"{number} {item.kind}"
        for colour, thick in (((0, 0, 0), 3), ((255, 255, 255), 1)):
            cv2.putText(
                tile, text, (5, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, thick, cv2.LINE_AA
            )
        tiles.append(tile)
    columns = min(6, len(tiles))
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % columns)
    rows = [np.hstack(tiles[start : start + columns]) for start in range(0, len(tiles), columns)]
    return np.asarray(np.vstack(rows), dtype=np.uint8)
