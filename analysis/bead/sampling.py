"""The strip: one remap that undoes lens, perspective and the seam's curve at once."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from . import loops
from .curve import Centreline
from .image import Photo, opponent
from .loops import loaded
from .plane import Plane

Floats = NDArray[np.float32]

_SMALLEST = 4
"""Pixels of a side that are enough to sample between."""


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

    def places(self, rows: NDArray[np.int64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places in the plane, (n, 2), of rows (the last one for those beyond) and columns."""
        rows = np.minimum(rows, len(self.line.s) - 1)
        across = self.offset(columns)[:, None] * self.line.normals[rows]
        return np.asarray(self.line.points[rows] + across)


def sample_strip(
    photo: Photo, plane: Plane, line: Centreline, reach: float, step: float, blur: float = 1.0
) -> Strip:
    """Sample the photo along `line`, `reach` to both sides, every `step` across.

    `blur` is the length of a step in photo px: from 2 on the photo is halved, as often as samples
    still lie at least one of its pixels apart.
    """
    count = int(np.ceil(reach / step))
    offsets = np.arange(-count, count + 1, dtype=np.float64) * step
    first = np.full(len(line.s), offsets[0])
    opponent, valid = sample_rows(photo, plane, line, first, step, len(offsets), blur)
    return Strip(line, opponent, valid, offsets, step)


def sample_rows(
    photo: Photo,
    plane: Plane,
    line: Centreline,
    first: NDArray[np.float64],
    step: float,
    count: int,
    blur: float = 1.0,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Opponent channels at `count` offsets from `line`, and which of them are in the photo.

    Each row begins at its offset `first` and goes on by `step`, which may be negative. Shapes
    (rows, count, channels) and (rows, count); for `blur` see `sample_strip`.
    """
    x, y = _maps(plane, line, first, step, count)
    factor = 1
    while 2 * factor <= min(blur, photo.width_px / _SMALLEST, photo.height_px / _SMALLEST):
        factor *= 2
    pixels = photo.reduced(factor)
    inside, columns = _place(x, photo.width_px, factor)
    between, rows = _place(y, photo.height_px, factor)
    part = pixels[rows, columns] if factor > 1 else _deep(pixels[rows, columns])
    sampled = cv2.remap(part, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return opponent(sampled), inside & between


def _place(at: Floats, size: int, factor: int) -> tuple[NDArray[np.bool_], slice]:
    """Make coordinates along one side of the photo those within a part of the reduced one.

    Which of them lie in the photo, and that part.
    """
    low, high = float(at.min()), float(at.max())
    inside = np.ones(at.shape, dtype=bool)
    if low < 0 or high > size - 1:
        inside = (at >= 0) & (at <= size - 1)
    first = min(max(int(low / factor) - 3, 0), size // factor - _SMALLEST)
    last = max(int(high / factor) + 5, first + _SMALLEST)
    if factor > 1:
        at += np.float32(0.5)
        at /= np.float32(factor)
        at -= np.float32(0.5)
    at -= np.float32(first)
    return inside, slice(first, last)


def _deep(pixels: NDArray[Any]) -> NDArray[Any]:
    """Pixels of 16 bit, so that samples between them are not rounded to grey levels."""
    if pixels.dtype == np.uint16:
        return pixels
    return np.asarray(np.multiply(pixels, np.uint16(257), dtype=np.uint16))


def _maps(
    plane: Plane, line: Centreline, first: NDArray[np.float64], step: float, count: int
) -> tuple[Floats, Floats]:
    """Photo coordinates of all samples: numerators and denominator are linear along a row."""
    matrix = plane.px_from_plane
    start = line.points + first[:, None] * line.normals
    base = start @ matrix[:, :2].T + matrix[:, 2]
    slope = step * line.normals @ matrix[:, :2].T
    project = loaded(loops.projected) or _projected
    x, y = project(base.astype(np.float32), slope.astype(np.float32), count)
    x, y = plane.through_lens(x, y)
    return np.asarray(x, dtype=np.float32), np.asarray(y, dtype=np.float32)


def _projected(base: Floats, slope: Floats, count: int) -> tuple[Floats, Floats]:
    """What `base` (rows, 3) and `count` steps of `slope` are in homogeneous coordinates: x, y."""
    at = np.arange(count, dtype=np.float32)
    x, y, w = (base[:, k, None] + slope[:, k, None] * at for k in range(3))
    x /= w
    y /= w
    return x, y
