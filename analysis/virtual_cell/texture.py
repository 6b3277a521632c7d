"""Surfaces seen by the virtual cameras: brushed and mill-scaled steel, blotches, sensor noise."""

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Shades = NDArray[np.float32]


def blotches(rng: np.random.Generator, shape: tuple[int, int], size_px: float) -> Shades:
    """Smooth noise of unit standard deviation with spots of about `size_px`."""
    small = (max(4, round(shape[0] / size_px) + 3), max(4, round(shape[1] / size_px) + 3))
    noise = rng.standard_normal(small).astype(np.float32)
    grown = np.asarray(cv2.resize(noise, shape[::-1], interpolation=cv2.INTER_CUBIC))
    return np.asarray(grown / grown.std(), dtype=np.float32)


def brushed(rng: np.random.Generator, shape: tuple[int, int], length_px: float) -> Shades:
    """Streaks along the rows of unit standard deviation, `length_px` long."""
    noise = rng.standard_normal(shape).astype(np.float32)
    streaks = np.asarray(cv2.GaussianBlur(noise, (0, 0), sigmaX=length_px, sigmaY=0.6))
    return np.asarray(streaks / streaks.std(), dtype=np.float32)


def steel(rng: np.random.Generator, shape: tuple[int, int], px_per_mm: float) -> Shades:
    """Grey of a brushed plate with patches of mill scale, BGR, shape (rows, columns, 3)."""
    grey = 138.0 + 7.0 * brushed(rng, shape, 9.0 * px_per_mm)
    grey += 4.0 * brushed(rng, shape, 1.2 * px_per_mm) + 5.0 * blotches(rng, shape, 45 * px_per_mm)
    scale = np.clip(blotches(rng, shape, 14 * px_per_mm) - 1.1, 0.0, 1.0)
    grey -= 30.0 * scale
    warm = 2.0 * blotches(rng, shape, 60 * px_per_mm) + 3.0 * scale
    return np.stack([grey - warm + 3.0, grey, grey + warm - 2.0], axis=-1).astype(np.float32)


def sensor_noise(rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.int16]:
    """One field of webcam noise: grey, colour and a little banding, shape (rows, columns, 3)."""
    grey = 2.4 * cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), 0.7)
    colour = rng.standard_normal((*shape, 3)).astype(np.float32)
    colour = np.asarray(cv2.GaussianBlur(colour, (0, 0), 1.4))
    banding = 0.5 * rng.standard_normal((shape[0], 1)).astype(np.float32)
    total = 1.6 * grey[..., None] + 3.0 * colour + banding[..., None]
    return np.asarray(np.rint(total), dtype=np.int16)


def rounded(shades: NDArray[np.number]) -> Picture:
    """Shades as 8 bit."""
    return np.asarray(np.clip(np.rint(shades), 0, 255), dtype=np.uint8)
