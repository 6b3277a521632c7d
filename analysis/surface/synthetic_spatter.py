"""Spatter on a rendered plate, of exactly known place and size, to check how it is found."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.bead.image import Photo, make_photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane, plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import Scene, render


@dataclass(frozen=True)
class Spattered:
    """A measured photo and its drops, rows of x px, y px, radius px, contrast in grey levels.

    `clean` is the same plate without them.
    """

    photo: Photo
    plane: Plane
    bead: BeadMeasurement
    drops: NDArray[np.float64]
    clean: Photo


def spattered(scene: Scene, drops: int, seed: int) -> Spattered:
    """A scene with discs of 0.15 to 0.6 mm radius, bright or dark, 0 to 10 mm from the toes."""
    bare = render(replace(scene, noise=0.0, blur_px=0.0), seed)
    plane = plane_of(make_photo(bare.pixels, "bare"), bare.calibration)
    rng = np.random.default_rng(seed + 1000)
    picture = bare.pixels.astype(np.float64)
    seam_mm = np.column_stack([bare.x_mm, bare.y_mm])
    widest = float(max(bare.left_mm.max(), bare.right_mm.max()))
    found: list[tuple[float, float, float, float]] = []
    while len(found) < drops:
        x, y = rng.uniform(0, picture.shape[1]), rng.uniform(0, picture.shape[0])
        radius = float(rng.uniform(0.15, 0.6))
        away = np.hypot(*(seam_mm - plane.to_plane(np.array([[x, y]]))).T).min()
        if widest + radius < away < widest + 10:
            grey = float(rng.choice([-50.0, 70.0]))
            reach = radius / scene.mm_per_px
            _draw(picture, x, y, reach, grey)
            found.append((x, y, reach, grey))
    photo = photographed(picture, scene, rng)
    measured = measure_strip(photo, plane, bare.wandering_path(seed=seed))
    clean = photographed(bare.pixels.astype(np.float64), scene, rng)
    return Spattered(photo, plane, measured, np.array(found).reshape(-1, 4), clean)


def _draw(picture: NDArray[np.float64], x: float, y: float, radius: float, grey: float) -> None:
    top, left = max(0, int(y - radius) - 1), max(0, int(x - radius) - 1)
    patch = picture[top : int(y + radius) + 3, left : int(x + radius) + 3]
    rows, columns = np.indices(patch.shape)
    patch += grey * np.clip(radius + 0.5 - np.hypot(columns + left - x, rows + top - y), 0, 1)


def photographed(picture: NDArray[np.float64], scene: Scene, rng: np.random.Generator) -> Photo:
    """A picture as the scene's camera takes it: blurred, with noise, 8 bit."""
    blurred = cv2.GaussianBlur(picture, (0, 0), scene.blur_px)
    noisy = blurred + scene.noise * rng.standard_normal(blurred.shape)
    return make_photo(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), "plate")


def matched(
    x_px: NDArray[np.float64], y_px: NDArray[np.float64], drops: NDArray[np.float64]
) -> int:
    """How many found drops lie on a true one of their own."""
    free = list(range(len(drops)))
    hits = 0
    for x, y in zip(x_px, y_px, strict=True):
        away = [np.hypot(drops[k, 0] - x, drops[k, 1] - y) for k in free]
        if away and min(away) <= max(3.0, drops[free[int(np.argmin(away))], 2]):
            free.pop(int(np.argmin(away)))
            hits += 1
    return hits
