"""Top of the table as a picture in the table frame: T-slots, two plates, seam, clamps, fresh bead.

Rows grow with x, columns with y, `PX_PER_MM` each; the webcam's pictures are taken from it.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from .seam import MARGIN_MM, WELD_LENGTH_MM, TrueSeam
from .texture import Picture, Shades, blotches, brushed, rounded, steel

PX_PER_MM = 2.5
X_FROM_MM, X_TO_MM = -212.0, 212.0
Y_FROM_MM, Y_TO_MM = -60.0, 260.0
_PLATE_X_MM = 62.0
_SHIFT = 4
"""Fractional bits of cv2's drawing coordinates."""

MM_FROM_CANVAS = np.array(
    [[0.0, 1.0 / PX_PER_MM, X_FROM_MM], [1.0 / PX_PER_MM, 0.0, Y_FROM_MM], [0.0, 0.0, 1.0]]
)
"""(column, row) of the canvas to (x, y) of the table frame."""


class Workpiece:
    """The canvas, on which the bead grows."""

    def __init__(self, seam: TrueSeam, rng: np.random.Generator) -> None:
        self._rng = rng
        shape = (
            round((X_TO_MM - X_FROM_MM) * PX_PER_MM),
            round((Y_TO_MM - Y_FROM_MM) * PX_PER_MM),
        )
        canvas = _table_top(rng, shape)
        _lay_plates(canvas, seam, rng)
        self.canvas: Picture = rounded(canvas)
        for x_mm, y_mm in ((-52, -8), (52, -8), (-52, 208), (52, 208)):
            _draw_clamp(self.canvas, float(x_mm), float(y_mm))
        self._bead_y_mm: float | None = None

    def deposit(self, x_mm: float, y_mm: float, width_mm: float) -> None:
        """Lay bead up to (x, y): ripples each millimetre, and heat tint around them."""
        if self._bead_y_mm is None:
            self._bead_y_mm = y_mm - 1.0
        while self._bead_y_mm + 1.0 <= y_mm:
            self._bead_y_mm += 1.0
            self._tint(x_mm, self._bead_y_mm)
            self._ripple(x_mm, self._bead_y_mm, width_mm)

    def _tint(self, x_mm: float, y_mm: float) -> None:
        column, row = canvas_px(x_mm, y_mm)
        reach = round(16 * PX_PER_MM)
        top, left = round(row) - reach, round(column) - reach
        area = self.canvas[top : top + 2 * reach, left : left + 2 * reach]
        area[:] = rounded(area * _TINT[: area.shape[0], : area.shape[1]])

    def _ripple(self, x_mm: float, y_mm: float, width_mm: float) -> None:
        tone = float(self._rng.normal(0.0, 7.0))
        centre = _fixed_point(x_mm, y_mm)
        half = 0.5 * width_mm * PX_PER_MM * float(self._rng.normal(1.0, 0.02))
        for share, grey in ((1.0, 70.0), (0.84, 112.0), (0.58, 146.0), (0.3, 160.0)):
            axes = (round(0.62 * share * half * 2**_SHIFT), round(share * half * 2**_SHIFT))
            shade = grey + tone
            colour = (shade, shade, shade - 2.0)
            cv2.ellipse(self.canvas, centre, axes, 0, -90, 90, colour, -1, cv2.LINE_AA, _SHIFT)


def canvas_px(x_mm: float, y_mm: float) -> tuple[float, float]:
    """Column and row on the canvas."""
    return (y_mm - Y_FROM_MM) * PX_PER_MM, (x_mm - X_FROM_MM) * PX_PER_MM


def _fixed_point(x_mm: float, y_mm: float) -> tuple[int, int]:
    column, row = canvas_px(x_mm, y_mm)
    return round(column * 2**_SHIFT), round(row * 2**_SHIFT)


def _heat_tint() -> Shades:
    reach = round(16 * PX_PER_MM)
    rows, columns = np.mgrid[-reach:reach, -reach:reach] / PX_PER_MM
    spot = np.exp(-0.5 * (rows**2 + columns**2) / 5.0**2)
    return np.asarray(1.0 - spot[..., None] * np.array([0.026, 0.029, 0.032]), dtype=np.float32)


_TINT = _heat_tint()


def _table_top(rng: np.random.Generator, shape: tuple[int, int]) -> Shades:
    grey = 62.0 + 3.0 * brushed(rng, shape, 14.0) + 4.0 * blotches(rng, shape, 120.0)
    x_mm = X_FROM_MM + np.arange(shape[0]) / PX_PER_MM
    from_slot = np.abs((x_mm + 25.0) % 50.0 - 25.0)
    profile = np.where(from_slot < 4.0, 0.32, 1.0)
    profile = np.where((from_slot >= 4.0) & (from_slot < 4.8), 1.35, profile)
    grey = grey * profile[:, None]
    return np.stack([1.04 * grey, grey, 0.97 * grey], axis=-1).astype(np.float32)


def _lay_plates(canvas: Shades, seam: TrueSeam, rng: np.random.Generator) -> None:
    shape = canvas.shape[:2]
    x = X_FROM_MM + (np.arange(shape[0]) + 0.5) / PX_PER_MM
    y = Y_FROM_MM + (np.arange(shape[1]) + 0.5) / PX_PER_MM
    inset = np.minimum(
        _PLATE_X_MM - np.abs(x)[:, None],
        np.minimum(y + MARGIN_MM, WELD_LENGTH_MM + MARGIN_MM - y)[None, :],
    )
    shadow = np.clip(1.0 + inset / 5.0, 0.0, 1.0)
    canvas *= (1.0 - 0.6 * shadow)[..., None]
    covers = np.clip(0.5 + inset * PX_PER_MM, 0.0, 1.0)[..., None]
    plate = steel(rng, (shape[0], shape[1]), PX_PER_MM)
    plate *= (1.0 + 0.25 * np.exp(-np.clip(inset, 0, None) / 0.5))[..., None]
    _cut_seam(plate, x[:, None] - seam.x_mm(y)[None, :])
    canvas[:] = covers * plate + (1.0 - covers) * canvas


def _cut_seam(plate: Shades, beside_mm: NDArray[np.float64]) -> None:
    """A gap of 0.4 mm with ground edges: dark between, bright at the lower edge."""
    gap = np.exp(-((beside_mm / 0.62) ** 4))
    ground = np.exp(-0.5 * (beside_mm / 3.2) ** 2)
    lit = np.exp(-0.5 * ((beside_mm - 1.0) / 0.35) ** 2)
    plate *= (1.0 + 0.16 * ground + 0.22 * lit)[..., None]
    plate *= (1.0 - 0.86 * gap)[..., None]


def _draw_clamp(canvas: Picture, x_mm: float, y_mm: float) -> None:
    """A strap with a bolt, and its shadow."""
    column, row = (round(value) for value in canvas_px(x_mm, y_mm))
    for shift, shades in ((6, (26, 26, 27)), (0, (52, 66, 168))):
        first = (column - 26 + shift, row - 58 + shift)
        last = (column + 26 + shift, row + 58 + shift)
        cv2.rectangle(canvas, first, last, shades, -1, cv2.LINE_AA)
    cv2.rectangle(canvas, (column - 26, row - 58), (column - 20, row + 58), (82, 98, 200), -1)
    for radius, shade in ((19, 38), (16, 128), (9, 60)):
        cv2.circle(canvas, (column, row), radius, (shade, shade, shade), -1, cv2.LINE_AA)
    cv2.ellipse(canvas, (column, row), (14, 14), 0, 190, 300, (190, 190, 188), 2, cv2.LINE_AA)
