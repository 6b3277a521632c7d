"""Pores, cracks and undercut in a rendered bead, of known place, to check how they are found."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.bead.image import Photo, make_photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane, plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import Scene, SyntheticBead, render

from .synthetic_spatter import photographed

Grid = NDArray[np.float64]

KINDS = ("pore", "crack", "undercut")


@dataclass(frozen=True)
class Flaw:
    """One flaw: `x_px`, `y_px` its middle in the photo, `reach_px` how far it goes from there."""

    kind: str
    x_px: float
    y_px: float
    reach_px: float

    def is_at(self, x_px: float, y_px: float) -> bool:
        """Whether a place found is this flaw's, to a few px."""
        return bool(np.hypot(x_px - self.x_px, y_px - self.y_px) <= self.reach_px + 4)


@dataclass(frozen=True)
class Flawed:
    """A measured photo of a bead and its flaws."""

    photo: Photo
    plane: Plane
    bead: BeadMeasurement
    flaws: tuple[Flaw, ...]


def flawed(scene: Scene, kinds: tuple[str, ...], seed: int, dark: float = 55.0) -> Flawed:
    """A scene with one flaw of each of `kinds`, evenly along the bead.

    Pores are 0.6 to 1 mm across, cracks 3 to 5 mm long and 0.2 mm wide, undercut 4 to 6 mm long and
    0.5 mm wide, all by `dark` grey levels darker than what is around them.
    """
    bare = render(replace(scene, noise=0.0, blur_px=0.0), seed)
    plane = plane_of(make_photo(bare.pixels, "bare"), bare.calibration)
    rng = np.random.default_rng(seed + 2000)
    picture = bare.pixels.astype(np.float64)
    inside_mm = scene.mm_per_px * scene.width_px * np.linspace(0.12, 0.88, max(len(kinds), 1))
    at_mm = np.interp(inside_mm, bare.x_mm, bare.s_mm)[: len(kinds)]
    flaws = []
    for kind, s_mm in zip(kinds, at_mm, strict=True):
        line_mm, wide_mm = _DRAWN[kind](bare, float(s_mm), rng)
        px = plane.to_px(line_mm)
        scale = plane.unit_per_px(px)
        picture -= dark * _stroke(picture.shape, px, wide_mm / scale)
        middle = px.mean(axis=0)
        reach = float(np.hypot(*(px - middle).T).max()) + wide_mm / scale
        flaws.append(Flaw(kind, float(middle[0]), float(middle[1]), reach))
    photo = photographed(picture, scene, rng)
    bead = measure_strip(photo, plane, bare.wandering_path(seed=seed))
    return Flawed(photo, plane, bead, tuple(flaws))


def _pore(bare: SyntheticBead, s_mm: float, rng: np.random.Generator) -> tuple[Grid, float]:
    place = _line(bare, np.array([s_mm, s_mm + 0.01]), rng.uniform(-0.5, 0.5) * 3.0)
    return place, float(rng.uniform(0.6, 1.0))


def _crack(bare: SyntheticBead, s_mm: float, rng: np.random.Generator) -> tuple[Grid, float]:
    half = rng.uniform(1.5, 2.5)
    s = np.linspace(s_mm - half, s_mm + half, 60)
    wander = 0.25 * np.sin(2 * np.pi * (s - s_mm) / 3.0 + rng.uniform(0, 6))
    return _line(bare, s, rng.uniform(-1.0, 1.0) + wander), 0.2


def _undercut(bare: SyntheticBead, s_mm: float, rng: np.random.Generator) -> tuple[Grid, float]:
    half = rng.uniform(2.0, 3.0)
    s = np.linspace(s_mm - half, s_mm + half, 60)
    side, toe = (-1, bare.left_mm) if rng.random() < 0.5 else (1, bare.right_mm)
    return _line(bare, s, side * (np.interp(s, bare.s_mm, toe) + 0.3)), 0.5


_DRAWN = {"pore": _pore, "crack": _crack, "undercut": _undercut}


def _line(bare: SyntheticBead, s_mm: Grid, offset_mm: Grid | float) -> Grid:
    """Points at offsets from the seam, table frame, shape (n, 2)."""
    x, y = (np.interp(s_mm, bare.s_mm, values) for values in (bare.x_mm, bare.y_mm))
    slope = np.interp(s_mm, bare.s_mm, np.gradient(bare.y_mm, bare.x_mm))
    across = np.stack([-slope, np.ones_like(slope)], axis=1) / np.hypot(1.0, slope)[:, None]
    return np.asarray(np.stack([x, y], axis=1) + np.asarray(offset_mm)[..., None] * across)


def _stroke(shape: tuple[int, ...], px: Grid, wide_px: float) -> Grid:
    """A line of a breadth, 0 to 1 by the part of each pixel that it covers."""
    fine = 4
    low = np.floor(px.min(axis=0) - wide_px - 2).astype(int)
    size = np.ceil(px.max(axis=0) + wide_px + 2).astype(int) - low
    drawn = np.zeros((size[1] * fine, size[0] * fine), np.uint8)
    points = np.rint((px - low + 0.5) * fine - 0.5).astype(np.int32)
    cv2.polylines(drawn, [points], False, 255, max(1, round(wide_px * fine)))
    part = cv2.resize(drawn, (int(size[0]), int(size[1])), interpolation=cv2.INTER_AREA) / 255.0
    whole = np.zeros(shape)
    top, left = max(int(low[1]), 0), max(int(low[0]), 0)
    inside = whole[top : int(low[1] + size[1]), left : int(low[0] + size[0])]
    inside[...] = part[top - int(low[1]) :, left - int(low[0]) :][
        : inside.shape[0], : inside.shape[1]
    ]
    return whole
