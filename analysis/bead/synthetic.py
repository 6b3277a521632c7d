"""Rendered beads with exactly known toes, to check the measurement and the user's own set-up.

A plane picture of a bead along a sine seam; both half widths vary smoothly and independently.
Every nuisance (ripple, shading, specular line, dark toe, spatter, heat tint, noise...) is a field
of `Scene`.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import PlaneCalibration

from .synthetic_surface import (
    Surface,
    brushed,
    film_colour,
    film_nm,
    smooth_noise,
    spatter_discs,
    specular_line,
)

Floats = NDArray[np.float64]

RIPPLE_MM = 0.9
_SUB = 3
"""Sub-samples of a pixel along each of its sides."""


@dataclass(frozen=True, slots=True)
class Scene:
    """What is rendered; lengths in mm unless named px, strengths in grey levels of 8 bit."""

    width_px: int = 1024
    height_px: int = 512
    mm_per_px: float = 0.1
    base: float = 90.0
    contrast: float = 80.0
    half_width_mm: float = 3.0
    blur_px: float = 1.0
    noise: float = 0.0
    ripple: float = 0.0
    scallop_mm: float = 0.0
    haz: float = 0.0
    texture: float = 0.0
    dark_toe: float = 0.0
    specular: float = 0.0
    gradient: float = 0.0
    spatter: int = 0
    perspective: float = 0.0
    gaps: int = 0
    tint_mm: float = 0.0
    tint_nm: float = 90.0


CASES: dict[str, Scene] = {
    "clean": Scene(),
    "snr 20": Scene(noise=4),
    "snr 5": Scene(noise=16),
    "blur 3": Scene(blur_px=3, noise=4),
    "ripple": Scene(ripple=18, scallop_mm=0.12, noise=2),
    "haz + texture": Scene(haz=35, texture=8, noise=2, gradient=0.4),
    "specular": Scene(specular=1, ripple=12, noise=2),
    "dark toe": Scene(dark_toe=40, haz=20, noise=2),
    "low contrast": Scene(contrast=20, texture=4, noise=3, ripple=5),
    "spatter": Scene(spatter=60, noise=2),
    "perspective": Scene(perspective=1, noise=2),
    "hard": Scene(
        ripple=15,
        scallop_mm=0.10,
        haz=30,
        texture=8,
        specular=1,
        dark_toe=25,
        spatter=40,
        gradient=0.4,
        perspective=1,
        noise=3,
        blur_px=1.3,
    ),
}
"""The named cases of the benchmarks."""

TINT = Scene(
    base=150.0,
    contrast=-10.0,
    ripple=22,
    scallop_mm=0.08,
    dark_toe=30,
    texture=4,
    noise=2,
    tint_mm=6,
)
"""A bead inside its heat tint: an oxide film `tint_nm` thick that ends `tint_mm` from the toes."""


@dataclass(frozen=True, slots=True)
class SyntheticBead:
    """A rendered photo (uint8, rows x columns, B, G, R too with a heat tint) and its truth.

    The seam is sampled densely: `x_mm`, `y_mm`, arc length `s_mm`, half widths `left_mm` (towards
    smaller y) and `right_mm`. `gaps_mm` holds the intervals of s without bead.
    """

    pixels: NDArray[np.uint8]
    calibration: PlaneCalibration
    x_mm: Floats
    y_mm: Floats
    s_mm: Floats
    left_mm: Floats
    right_mm: Floats
    gaps_mm: tuple[tuple[float, float], ...]

    def seam_s_mm(self, points_mm: Floats) -> Floats:
        """Arc length of the seam nearest to plane points, shape (n, 2)."""
        seam = _Seam(self.x_mm, self.y_mm, self.s_mm)
        return seam.locate(points_mm[:, 0], points_mm[:, 1])[0]

    def width_at_mm(self, s_mm: Floats) -> Floats:
        """True bead width, toe to toe across the seam."""
        return np.interp(s_mm, self.s_mm, self.left_mm + self.right_mm)

    def wandering_path(self, wander_mm: float = 0.5, seed: int = 0) -> Floats:
        """The seam displaced across by smooth noise (15 mm correlation), shape (n, 2)."""
        step = float(np.median(np.diff(self.s_mm)))
        rng = np.random.default_rng(seed)
        offset = wander_mm * smooth_noise(rng, len(self.s_mm), 15.0 / step)
        slope = np.gradient(self.y_mm, self.x_mm)
        length = np.hypot(1.0, slope)
        x, y = self.x_mm - offset * slope / length, self.y_mm + offset / length
        return np.column_stack([x, y])[:: max(1, round(2.0 / step))]


@dataclass(frozen=True, slots=True)
class _Seam:
    x_mm: Floats
    y_mm: Floats
    s_mm: Floats

    def locate(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Arc length and signed offset (positive towards larger y) of points near the seam."""
        slope = np.gradient(self.y_mm, self.x_mm)
        foot = x.copy()
        for _ in range(4):
            height = np.interp(foot, self.x_mm, self.y_mm)
            tilt = np.interp(foot, self.x_mm, slope)
            foot += ((x - foot) + (y - height) * tilt) / (1.0 + tilt * tilt)
        height, tilt = np.interp(foot, self.x_mm, self.y_mm), np.interp(foot, self.x_mm, slope)
        length = np.sqrt(1.0 + tilt * tilt)
        return np.interp(foot, self.x_mm, self.s_mm), ((y - height) - (x - foot) * tilt) / length


def _seam(scene: Scene) -> _Seam:
    length = scene.width_px * scene.mm_per_px
    x = np.arange(-0.15 * length, 1.15 * length, scene.mm_per_px / 2)
    middle = scene.height_px * scene.mm_per_px / 2
    y = middle + 4.0 * np.sin(2 * np.pi * x / (0.9 * length) + 0.3)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    return _Seam(x, y, s - np.interp(0.0, x, s))


def _half_widths(scene: Scene, seam: _Seam, rng: np.random.Generator) -> tuple[Floats, Floats]:
    step = float(np.median(np.diff(seam.s_mm)))
    scallop = scene.scallop_mm * (np.abs(np.sin(np.pi * seam.s_mm / RIPPLE_MM)) - 0.64)
    left, right = (
        scene.half_width_mm + 0.175 * smooth_noise(rng, len(seam.s_mm), 6.0 / step) + scallop
        for _ in range(2)
    )
    return left, right


def _homography(scene: Scene, rng: np.random.Generator) -> NDArray[np.float64]:
    width, height = float(scene.width_px), float(scene.height_px)
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float32)
    moved = corners + scene.perspective * 0.06 * width * rng.uniform(-0.5, 0.5, (4, 2))
    plane = (corners + 0.5) * scene.mm_per_px
    return np.asarray(
        cv2.getPerspectiveTransform(moved.astype(np.float32), plane.astype(np.float32))
    )


def _gaps(scene: Scene, rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    length = scene.width_px * scene.mm_per_px
    starts = (np.arange(scene.gaps) + rng.uniform(0.35, 0.65, scene.gaps)) / max(scene.gaps, 1)
    return tuple((float(s * length), float(s * length + 3.0)) for s in starts)


def render(scene: Scene, seed: int = 0) -> SyntheticBead:
    """Render `scene`; the same seed gives the same picture."""
    rng = np.random.default_rng(seed)
    seam = _seam(scene)
    left, right = _half_widths(scene, seam, rng)
    matrix = _homography(scene, rng)
    gaps = _gaps(scene, rng)
    surface = Surface(
        base=scene.base,
        contrast=scene.contrast,
        ripple=scene.ripple,
        ripple_mm=RIPPLE_MM,
        haz=scene.haz,
        dark_toe=scene.dark_toe,
        specular=scene.specular,
        line=specular_line(rng, seam.s_mm),
        seam_s_mm=seam.s_mm,
        left_mm=left,
        right_mm=right,
        gaps_mm=gaps,
        footprint_mm=scene.mm_per_px / _SUB,
    )
    picture, plate = _sample(scene, seam, surface, matrix)
    picture += plate * brushed(rng, picture.shape, scene.texture)
    spatter_discs(rng, picture, scene.spatter, seam.locate, matrix, scene.mm_per_px, left, right)
    picture *= _gradient(scene)
    if scene.tint_mm:
        picture = picture[..., None] * _tint(scene, seam, surface, matrix)
    blurred = cv2.GaussianBlur(picture, (0, 0), scene.blur_px) if scene.blur_px else picture
    picture = blurred + scene.noise * rng.standard_normal(picture.shape)
    calibration = PlaneCalibration(
        image_width_px=scene.width_px,
        image_height_px=scene.height_px,
        plane_mm_from_px=tuple(tuple(float(v) for v in row) for row in matrix),
        residual_mm=0.0,
        scale_relative_u=0.0,
        source="rendered",
    )
    pixels = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    return SyntheticBead(pixels, calibration, seam.x_mm, seam.y_mm, seam.s_mm, left, right, gaps)


def _gradient(scene: Scene) -> Floats:
    x = np.arange(scene.width_px) / scene.width_px - 0.5
    y = np.arange(scene.height_px) / scene.height_px
    return 1.0 + scene.gradient * (x[None, :] + 0.6 * y[:, None])


def _tint(
    scene: Scene, seam: _Seam, surface: Surface, matrix: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Part of the light that each pixel keeps in B, G, R; the film covers the bead as well."""
    columns, rows = np.meshgrid(np.arange(scene.width_px) * 1.0, np.arange(scene.height_px) * 1.0)
    x, y, w = (row[0] * columns + row[1] * rows + row[2] for row in matrix)
    s, offset = seam.locate((x / w).ravel(), (y / w).ravel())
    outside = np.abs(offset) - surface.half_width(s, offset)
    thick = film_nm(outside, scene.tint_mm, scene.tint_nm)
    return film_colour(thick).reshape(scene.height_px, scene.width_px, 3)


def _sample(
    scene: Scene, seam: _Seam, surface: Surface, matrix: NDArray[np.float64]
) -> tuple[Floats, Floats]:
    """Mean of 3 x 3 sub-samples per pixel, and the fraction of each pixel that is plate."""
    columns, rows = np.meshgrid(
        np.arange(scene.width_px, dtype=np.float64), np.arange(scene.height_px, dtype=np.float64)
    )
    total, plate = np.zeros(rows.shape), np.zeros(rows.shape)
    for dy in (-1 / 3, 0.0, 1 / 3):
        for dx in (-1 / 3, 0.0, 1 / 3):
            u, v = columns + dx, rows + dy
            x, y, w = (row[0] * u + row[1] * v + row[2] for row in matrix)
            s, offset = seam.locate((x / w).ravel(), (y / w).ravel())
            value, outside = surface.grey(s, offset)
            total += value.reshape(rows.shape)
            plate += outside.reshape(rows.shape)
    return total / 9, plate / 9
