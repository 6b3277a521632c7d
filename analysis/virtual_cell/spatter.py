"""Spatter beside the bead: small domes with a rim and a highlight."""

import numpy as np
from numpy.typing import NDArray

from .texture import Shades

_DROPS = 46
_PX_PER_MM = 10.0


def scatter(
    picture: NDArray[np.floating], rng: np.random.Generator, outside_mm: NDArray[np.float32]
) -> None:
    """Put drops of 0.15 to 0.5 mm radius on the plate, denser near the toe."""
    rows, columns = outside_mm.shape
    placed = 0
    while placed < _DROPS:
        row, column = int(rng.integers(12, rows - 12)), int(rng.integers(12, columns - 12))
        distance = float(outside_mm[row, column])
        if distance < 0.9 or rng.random() > np.exp(-distance / 7.0):
            continue
        _put_drop(picture, rng, row, column)
        placed += 1


def _put_drop(
    picture: NDArray[np.floating], rng: np.random.Generator, row: int, column: int
) -> None:
    radius = _PX_PER_MM * float(rng.uniform(0.15, 0.5))
    reach = int(np.ceil(radius)) + 2
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float32)
    y, x = y + float(rng.uniform(-0.5, 0.5)), x + float(rng.uniform(-0.5, 0.5))
    from_centre = np.hypot(x, y)
    cover = np.clip(radius - from_centre + 0.5, 0.0, 1.0)
    dome = np.sqrt(np.clip(1.0 - (from_centre / radius) ** 2, 0.0, 1.0))
    tilt = -(x + 1.2 * y) / radius
    grey = 46.0 + 46.0 * dome + 34.0 * tilt + 90.0 * np.exp(-6.0 * (tilt - 0.9) ** 2) * dome
    shadow = 0.35 * np.clip(1.0 - np.hypot(x - 1.2, y - 1.6) / (radius + 1.2), 0.0, 1.0)
    area = picture[row - reach : row + reach + 1, column - reach : column + reach + 1]
    area *= (1.0 - shadow)[..., None]
    drop: Shades = np.stack([grey + 1.0, grey, grey - 2.0], axis=-1)
    area[:] = cover[..., None] * drop + (1.0 - cover[..., None]) * area
