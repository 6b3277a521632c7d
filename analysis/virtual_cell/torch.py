"""The welding torch as the webcam sees it from above, and the light of its arc."""

import cv2
import numpy as np
from numpy.typing import NDArray

from .texture import Picture, Shades, rounded

TIP_COLUMN, TIP_ROW = 70, 330
"""Where the nozzle's tip is in the sprite."""
_SHAPE = (352, 140)
_NOZZLE, _RING, _NECK = 62.0, 74.0, 205.0
"""Ends of the torch's parts, px above the tip."""


def torch_sprite() -> tuple[Shades, Shades]:
    """Colours, shape (352, 140, 3), and cover in [0, 1], shape (352, 140, 1)."""
    rows, columns = np.mgrid[: _SHAPE[0], : _SHAPE[1]].astype(np.float32)
    above = TIP_ROW - rows
    bend = 0.00045 * np.clip(above - 80.0, 0.0, None) ** 2
    half = np.interp(
        above,
        [0, 8, _NOZZLE, _RING, _RING + 1, 150, _NECK, _NECK + 8, 400],
        [13.5, 16, 20, 20, 13, 14, 15, 25, 31],
    )
    across = (columns - TIP_COLUMN - bend) / half
    cover = np.clip((1.0 - np.abs(across)) * half + 0.5, 0.0, 1.0)
    cover *= np.clip(above + 0.5 + 5.0 * np.sqrt(np.clip(1.0 - across**2, 0.0, 1.0)), 0.0, 1.0)
    round_ = np.sqrt(np.clip(1.0 - across**2, 0.0, 1.0))
    shine = np.exp(-0.5 * ((across + 0.38) / 0.13) ** 2)
    colours = _part_colours(above) * (0.28 + 0.72 * round_)[..., None]
    colours += (90.0 * shine * _gloss(above))[..., None]
    mouth = (above < 1.0) & (np.abs(across) < 0.75)
    colours[mouth] = (30.0, 34.0, 40.0)
    return colours.astype(np.float32), cover[..., None].astype(np.float32)


def _part_colours(above: NDArray[np.float32]) -> NDArray[np.float64]:
    colours = np.empty((*above.shape, 3))
    colours[:] = (38.0, 37.0, 36.0)
    colours[above < _RING] = (150.0, 150.0, 152.0)
    colours[above < _NOZZLE] = (72.0, 104.0, 148.0)
    colours[(above > _NECK + 30) & (above < _NECK + 44)] = (40.0, 40.0, 190.0)
    soot = np.clip(1.0 - above / 26.0, 0.0, 1.0)
    return np.asarray(colours * (1.0 - 0.65 * soot)[..., None])


def _gloss(above: NDArray[np.float32]) -> NDArray[np.float64]:
    return np.where(above < _NOZZLE, 1.0, np.where(above < _RING, 0.8, 0.35))


def draw_marker(picture: Picture, column: float, row: float) -> None:
    """The sticker on the torch: a white disc, a magenta ring, a black cross."""
    centre = (round(16 * column), round(16 * row))
    for radius, colour in ((12.5, (228, 232, 230)), (9.5, (150, 30, 205)), (5.5, (228, 232, 230))):
        cv2.circle(picture, centre, round(16 * radius), colour, -1, cv2.LINE_AA, 4)
    reach = round(16 * 9.5)
    for x, y in ((reach, 0), (0, reach)):
        start, end = (centre[0] - x, centre[1] - y), (centre[0] + x, centre[1] + y)
        cv2.line(picture, start, end, (25, 22, 24), 1, cv2.LINE_AA, 4)


def arc_glow(height_px: int, width_px: int) -> Picture:
    """Light of the arc about its centre, shape (2 height, 2 width, 3), to be added."""
    y, x = np.mgrid[-height_px:height_px, -width_px:width_px].astype(np.float32)
    radius = np.hypot(x, 1.15 * y)
    core = 900.0 * np.exp(-0.5 * (radius / 8.0) ** 2)
    near = 230.0 * np.exp(-radius / 26.0) + 60.0 / (1.0 + (radius / 75.0) ** 2)
    smear = 120.0 * np.exp(-0.5 * (y / 1.6) ** 2 - np.abs(x) / 95.0)
    star = sum(_ray(x, y, angle) for angle in (0.35, 1.4, 2.45))
    halo = 10.0 * np.exp(-0.5 * ((radius - 128.0) / 9.0) ** 2)
    white = core + near + smear + 70.0 * star
    light = np.stack([white + 0.6 * halo, 0.95 * white + 0.2 * halo, 0.88 * white], -1)
    trail = np.exp(-0.5 * (y / 4.5) ** 2 + np.where(x < 0, x / 16.0, -x / 3.0))
    light += trail[..., None] * np.array([20.0, 120.0, 255.0])
    return rounded(light.astype(np.float32))


def _ray(x: NDArray[np.float32], y: NDArray[np.float32], angle: float) -> NDArray[np.float32]:
    along = np.abs(x * np.cos(angle) + y * np.sin(angle))
    beside = -x * np.sin(angle) + y * np.cos(angle)
    return np.asarray(np.exp(-0.5 * (beside / 1.4) ** 2 - along / 34.0), dtype=np.float32)


def hot_metal(height_px: int = 40, width_px: int = 120) -> Shades:
    """Glow of the crater after the arc, about its centre, to be added."""
    y, x = np.mgrid[-height_px:height_px, -width_px:width_px].astype(np.float32)
    spot = np.exp(-0.5 * (y / 5.0) ** 2 + np.where(x < 0, x / 14.0, -x / 4.0))
    return np.asarray(spot[..., None] * np.array([30.0, 130.0, 255.0]), dtype=np.float32)
