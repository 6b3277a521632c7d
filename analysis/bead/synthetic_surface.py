"""The looks of a rendered bead and its plate: grey level as a function of place on the seam."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d
from scipy.special import erfc

Floats = NDArray[np.float64]

_WAVELENGTHS_NM = (450.0, 540.0, 610.0)
"""Of blue, green and red light."""
_FILM_INDEX = 2.3
"""Refractive index of an oxide film on steel."""
_FILM_DEPTH = 0.55
"""Part of the light that destructive interference takes."""


def smooth_noise(rng: np.random.Generator, count: int, correlation: float) -> Floats:
    """Gaussian noise of unit variance, smooth over `correlation` samples."""
    noise = gaussian_filter1d(rng.standard_normal(count), correlation / 2, mode="wrap")
    return np.asarray(noise / noise.std())


def brushed(rng: np.random.Generator, shape: tuple[int, ...], strength: float) -> Floats:
    """Texture of a brushed plate: streaks along x, standard deviation `strength`."""
    if not strength:
        return np.zeros(shape)
    noise = gaussian_filter(rng.standard_normal(shape), (0.7, 12.0))
    return np.asarray(strength * noise / noise.std())


def specular_line(rng: np.random.Generator, s_mm: Floats) -> tuple[Floats, Floats]:
    """Place across (fraction of the half width) and strength of a broken specular line."""
    step = float(np.median(np.diff(s_mm)))
    place = 0.25 + 0.08 * smooth_noise(rng, len(s_mm), 8.0 / step)
    return place, np.clip(0.5 + smooth_noise(rng, len(s_mm), 2.0 / step), 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Surface:
    """Grey levels of bead and plate; lengths in mm, half widths sampled at `seam_s_mm`."""

    base: float
    contrast: float
    ripple: float
    ripple_mm: float
    haz: float
    dark_toe: float
    specular: float
    line: tuple[Floats, Floats]
    seam_s_mm: Floats
    left_mm: Floats
    right_mm: Floats
    gaps_mm: tuple[tuple[float, float], ...]
    footprint_mm: float

    def grey(self, s: Floats, offset: Floats) -> tuple[Floats, Floats]:
        """Grey level at places (s, signed offset), and the part of each that is plate.

        A place is `footprint_mm` across; a toe that runs through it divides its area.
        """
        half = self.half_width(s, offset)
        outside = np.abs(offset) - half
        bead = np.clip(0.5 - outside / self.footprint_mm, 0.0, 1.0)
        for first, last in self.gaps_mm:
            bead[(s >= first) & (s < last)] = 0.0
        value = (1.0 - bead) * self._plate(outside)
        on_bead = bead > 0
        value[on_bead] += bead[on_bead] * self._bead(
            s[on_bead], (offset / half)[on_bead], half[on_bead]
        )
        return value, 1.0 - bead

    def half_width(self, s: Floats, offset: Floats) -> Floats:
        """Half width on the side of `offset`."""
        left = np.interp(s, self.seam_s_mm, self.left_mm)
        return np.where(offset < 0, left, np.interp(s, self.seam_s_mm, self.right_mm))

    def _plate(self, outside: Floats) -> Floats:
        value = np.full(outside.shape, self.base)
        if self.haz:
            value -= self.haz * np.exp(-((outside / 2.2) ** 2))
        if self.dark_toe:
            value -= self.dark_toe * np.exp(-0.5 * ((outside - 0.12) / 0.12) ** 2)
        return value

    def _bead(self, s: Floats, u: Floats, half: Floats) -> Floats:
        value = np.full(u.shape, self.base + self.contrast)
        if self.ripple:
            phase = 2 * np.pi * (s + 0.3 * 2 * half * u * u) / self.ripple_mm
            value += self.ripple * np.sin(phase)
            value += 0.5 * self.ripple * np.sin(2.3 * phase + 9 * u) * np.cos(37 * u + 1.7 * s)
        if self.specular:
            value -= 0.6 * self.contrast * self.specular * u**4
            place = np.interp(s, self.seam_s_mm, self.line[0])
            strength = np.interp(s, self.seam_s_mm, self.line[1])
            value += 160 * self.specular * strength * np.exp(-0.5 * ((u - place) / 0.10) ** 2)
        return value


def film_nm(outside_mm: Floats, reach_mm: float, thickest_nm: float) -> Floats:
    """Thickness of the oxide film at a distance from the toe: it fades out around `reach_mm`."""
    return np.asarray(0.5 * thickest_nm * erfc((outside_mm - reach_mm) / (0.3 * reach_mm)))


def film_colour(thick_nm: Floats) -> Floats:
    """Part of the light reflected in B, G, R: two-beam interference in the film, shape (..., 3)."""
    phase = 4 * np.pi * _FILM_INDEX * thick_nm[..., None] / np.array(_WAVELENGTHS_NM)
    return np.asarray(1.0 - _FILM_DEPTH * (1.0 - np.cos(phase)) / 2)


def spatter_discs(
    rng: np.random.Generator,
    picture: Floats,
    count: int,
    locate: Callable[[Floats, Floats], tuple[Floats, Floats]],
    matrix: Floats,
    mm_per_px: float,
    left_mm: Floats,
    right_mm: Floats,
) -> None:
    """Draw `count` bright or dark discs into `picture`, 0-10 mm outside the toes."""
    widest = float(max(left_mm.max(), right_mm.max()))
    drawn = 0
    while drawn < count:
        x_px, y_px = rng.uniform(0, picture.shape[1]), rng.uniform(0, picture.shape[0])
        x, y, w = matrix @ (x_px, y_px, 1.0)
        _, offset = locate(np.array([x / w]), np.array([y / w]))
        radius = rng.uniform(0.15, 0.6)
        if widest + radius < abs(offset[0]) < widest + 10.0:
            _disc(picture, x_px, y_px, radius / mm_per_px, rng.choice([-50.0, 70.0]))
            drawn += 1


def _disc(picture: Floats, x_px: float, y_px: float, radius_px: float, grey: float) -> None:
    reach = int(radius_px) + 2
    top, left = max(0, int(y_px) - reach), max(0, int(x_px) - reach)
    patch = picture[top : int(y_px) + reach + 1, left : int(x_px) + reach + 1]
    rows, columns = np.indices(patch.shape)
    distance = np.hypot(rows + top - y_px, columns + left - x_px)
    patch += grey * np.clip(radius_px + 0.5 - distance, 0.0, 1.0)
