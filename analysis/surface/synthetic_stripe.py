"""Rendered laser stripes over a bead of exactly known heights, with gleams and ghosts.

Ghosts are bright pieces of line and spots off the stripe, brighter than the stripe itself.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

MM_PER_PX = 0.05
"""Of the frame, across and in height."""
ROW_OF_ZERO = 0.6
HEIGHT_MM, WIDTH_MM, STEP_MM, UNDERCUT_MM = 1.5, 8.0, 0.3, 0.25


def true_z_mm(x_mm: NDArray[np.float64], undercut_mm: float = UNDERCUT_MM) -> NDArray[np.float64]:
    """Two plates, the right one higher, a parabolic bead, undercut at its right toe."""
    across = x_mm / (WIDTH_MM / 2)
    inside = np.abs(across) < 1
    plate = 0.02 * x_mm + np.where(inside, STEP_MM * (across + 1) / 2, STEP_MM * (x_mm > 0))
    bead = np.where(inside, HEIGHT_MM * (1 - across**2), 0.0)
    groove = np.exp(-(((x_mm - (WIDTH_MM / 2 + 0.35)) / 0.22) ** 2))
    return np.asarray(plate + bead - undercut_mm * groove)


def stripe_frame(
    seed: int, ghosts: bool = True, columns: int = 800, rows: int = 400
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """A frame of the stripe (uint8, rows x columns) and the true row of each column."""
    rng = np.random.default_rng(seed)
    column = np.arange(columns, dtype=np.float64)
    row = np.arange(rows, dtype=np.float64)[:, None]
    true_row = ROW_OF_ZERO * rows - true_z_mm((column - columns / 2) * MM_PER_PX) / MM_PER_PX
    shine = cv2.GaussianBlur(rng.standard_normal((1, columns)), (0, 0), 10)[0]
    bright = 150 * (0.6 + 0.4 * np.clip(5 * shine + 0.5, 0, 1))
    picture = 12 + bright * np.exp(-0.5 * ((row - true_row) / 2.0) ** 2)
    for _ in range(6 if ghosts else 0):
        middle, length = rng.uniform(80, columns - 80), rng.uniform(15, 80)
        away = rng.choice([-1, 1]) * rng.uniform(15, 100)
        lit = np.abs(column - middle) < length / 2
        ghost = true_row[int(middle)] + away + 0.4 * (column[lit] - middle)
        picture[:, lit] += 230 * np.exp(-0.5 * ((row - ghost) / rng.uniform(1.5, 4)) ** 2)
        x, y = rng.uniform(0, columns), rng.uniform(0, rows)
        spot = ((column - x) ** 2 + (row - y) ** 2) / rng.uniform(3, 9) ** 2
        picture += 250 * np.exp(-0.5 * spot)
    if ghosts:
        picture[:, 250:262] = 12
    noisy = picture + 4 * rng.standard_normal(picture.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8), true_row
