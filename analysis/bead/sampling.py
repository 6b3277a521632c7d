"""The strip: one remap that undoes lens, perspective and the seam's curve at once."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .curve import Centreline
from .image import Photo, opponent
from .plane import Plane

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Strip:
    """A straightened bead: a row per place of `line`, a column per offset across it.

    `opponent` has shape (rows, columns, channels), `valid` tells which samples lie in the photo,
    `offsets` (columns,) are in the plane's unit, `step` is their distance.
    """

    line: Centreline
    opponent: Floats
    valid: NDArray[np.bool_]
    offsets: NDArray[np.float64]
    step: float

    def column(self, offset: NDArray[np.float64]) -> NDArray[np.float64]:
        """Column of an offset, as a fraction."""
        return np.asarray((offset - self.offsets[0]) / self.step)

    def offset(self, column: NDArray[np.float64]) -> NDArray[np.float64]:
        """Offset of a (fractional) column."""
        return np.asarray(self.offsets[0] + column * self.step)


def sample_strip(
    photo: Photo, plane: Plane, line: Centreline, reach: float, step: float, blur: float = 1.0
) -> Strip:
    """Sample the photo along `line`, `reach` to both sides, every `step` across.

    `blur` is the length of a step in photo px: above 1 the photo is averaged so that no detail
    falls between the samples.
    """
    count = int(np.ceil(reach / step))
    offsets = np.arange(-count, count + 1, dtype=np.float64) * step
    opponent, valid = sample_offsets(photo, plane, line, offsets[None], blur)
    return Strip(line, opponent, valid, offsets, step)


def sample_offsets(
    photo: Photo, plane: Plane, line: Centreline, offsets: NDArray[np.float64], blur: float = 1.0
) -> tuple[Floats, NDArray[np.bool_]]:
    """Opponent channels at `offsets` (rows or 1, columns) from `line`, and which are in the photo.

    Shapes (rows, columns, channels) and (rows, columns); for `blur` see `sample_strip`.
    """
    x, y = _maps(plane, line, offsets)
    valid = (x >= 0) & (x <= photo.width_px - 1) & (y >= 0) & (y <= photo.height_px - 1)
    left, right = _span(x, photo.width_px)
    top, bottom = _span(y, photo.height_px)
    part = photo.pixels[top:bottom, left:right]
    factor = 1
    while 2 * factor <= blur and min(part.shape[:2]) >= 2:
        part, factor = _halved(part), 2 * factor
    if blur / factor > 1.3:
        part = cv2.GaussianBlur(part, (0, 0), 0.4 * blur / factor)
    sampled = cv2.remap(
        part,
        ((x - left + 0.5) / factor - 0.5).astype(np.float32),
        ((y - top + 0.5) / factor - 0.5).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return opponent(sampled), valid


def _halved(pixels: NDArray[Any]) -> NDArray[Any]:
    """Means of whole blocks of 2 x 2 pixels; what is over at the far borders goes."""
    rows, columns = (size // 2 for size in pixels.shape[:2])
    whole = pixels[: 2 * rows, : 2 * columns]
    return cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)


def _span(values: NDArray[np.float64], size: int) -> tuple[int, int]:
    low = int(np.clip(np.floor(values.min()) - 3, 0, size - 4))
    return low, int(np.clip(np.ceil(values.max()) + 4, low + 4, size))


def _maps(
    plane: Plane, line: Centreline, offsets: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Photo coordinates of all samples: numerators and denominator are linear in the offset."""
    matrix = plane.px_from_plane()
    base = (line.points @ matrix[:, :2].T + matrix[:, 2]).astype(np.float32)
    slope = (line.normals @ matrix[:, :2].T).astype(np.float32)
    across = offsets.astype(np.float32)
    x, y, w = (base[:, k, None] + slope[:, k, None] * across for k in range(3))
    return plane.through_lens(x / w, y / w)
