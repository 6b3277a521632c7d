"""Looks of the weld in the photo: bead with ripples and gloss, heat tints, brushed plate."""

import cv2
import numpy as np
from numpy.typing import NDArray

from .texture import Shades, blotches, brushed, steel

Grid = NDArray[np.float32]
Values = NDArray[np.floating]

RIPPLE_MM = 0.9
SCALLOP_MM = 0.1
_PX_PER_MM = 10.0
_TINT_MM = (0.0, 0.8, 1.8, 3.0, 4.5, 6.5, 9.0, 14.0)
_TINT_BLUE = (0.90, 0.90, 0.89, 0.87, 0.87, 0.91, 0.96, 1.0)
_TINT_GREEN = (0.84, 0.84, 0.85, 0.87, 0.90, 0.94, 0.98, 1.0)
_TINT_RED = (0.80, 0.80, 0.82, 0.87, 0.93, 0.97, 0.99, 1.0)


def ripple_phase(s_mm: Values, offset_mm: Values, half_mm: Values) -> Values:
    """Phase of the solidification ripples, rad: arcs with their apex towards the start."""
    across = np.clip(offset_mm / np.maximum(half_mm, 0.05), -1.2, 1.2)
    return np.asarray(2.0 * np.pi * (s_mm - 0.6 * half_mm * across**2) / RIPPLE_MM)


def bead_colours(rng: np.random.Generator, s_mm: Grid, offset_mm: Grid, half_mm: Grid) -> Shades:
    """Convex metal under a lamp from above left, BGR."""
    shape = (s_mm.shape[0], s_mm.shape[1])
    across = np.clip(offset_mm / half_mm, -1.0, 1.0)
    grain = blotches(rng, shape, 5.0)
    phase = ripple_phase(s_mm, offset_mm, half_mm) + 0.9 * blotches(rng, shape, 28.0)
    ripple = np.cos(phase)
    tilt = -0.62 * across + 0.16 * ripple
    grey = 138.0 + 30.0 * tilt - 8.0 * across**4 + 10.0 * ripple + 4.5 * grain
    gleam = np.exp(-0.5 * ((across + 0.34 + 0.06 * blotches(rng, shape, 60.0)) / 0.13) ** 2)
    broken = np.clip(0.55 + 0.5 * ripple + 0.35 * blotches(rng, shape, 16.0), 0.0, 1.2)
    grey = grey + 66.0 * gleam * broken
    slag = np.clip(blotches(rng, shape, 13.0) - 1.75, 0.0, 0.8)[..., None]
    metal = np.stack([grey + 1.0, grey, grey - 3.0], axis=-1)
    return np.asarray((1.0 - slag) * metal + slag * np.array([42.0, 58.0, 76.0]), dtype=np.float32)


def plate_colours(
    rng: np.random.Generator, outside_mm: Grid, beside_seam_mm: Grid, welded: Grid
) -> Shades:
    """Brushed steel with heat tints beside the bead and the open gap where no bead lies, BGR."""
    shape = (outside_mm.shape[0], outside_mm.shape[1])
    plate = steel(rng, shape, _PX_PER_MM) * 0.74
    distance = np.clip(outside_mm * (1.0 + 0.10 * blotches(rng, shape, 90.0)), 0.0, 20.0)
    tints = (_TINT_BLUE, _TINT_GREEN, _TINT_RED)
    plate *= np.stack([np.interp(distance, _TINT_MM, tint) for tint in tints], axis=-1)
    soot = np.exp(-np.clip(distance - 1.0, 0.0, None) / 5.0) * np.clip(
        0.5 + 0.4 * blotches(rng, shape, 40.0), 0.0, 1.3
    )
    plate += (15.0 * soot + 4.0 * brushed(rng, shape, 5.0))[..., None]
    toe = np.exp(-0.5 * ((outside_mm - 0.10) / 0.14) ** 2)
    plate *= (1.0 - 0.10 * toe)[..., None]
    return np.asarray(_open_gap(plate.astype(np.float32), beside_seam_mm, welded))


def _open_gap(plate: Shades, beside_mm: Grid, welded: Grid) -> Shades:
    open_ = 1.0 - welded
    gap = np.clip(0.5 + (0.2 - np.abs(beside_mm)) * _PX_PER_MM, 0.0, 1.0) * open_
    lit = np.exp(-0.5 * ((beside_mm - 0.35) / 0.12) ** 2) * open_
    plate *= (1.0 + 0.25 * lit)[..., None]
    plate *= (1.0 - 0.8 * gap)[..., None]
    return np.asarray(cv2.GaussianBlur(plate, (0, 0), 0.5), dtype=np.float32)
