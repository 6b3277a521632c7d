"""Photos: decoded within limits, upright, as opponent channels: lightness and two colours."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ImageError
from seamlog.limits import LIMITS, Limits
from seamlog.pictures import PictureHeader, check_picture

_SMALLEST_PX = 16
OPPONENT = np.array([[0.25, 0.5, 0.25], [0.0, -1.0, 1.0], [-1.0, 0.5, 0.5]], dtype=np.float32)
"""Lightness, red - green and yellow - blue from B, G, R. Linear: a blurred edge stays in place."""


@dataclass(frozen=True, slots=True)
class Photo:
    """A decoded photo, upright.

    `pixels` has shape (rows, columns) for grey or (rows, columns, 3) for B, G, R; uint8 or uint16.
    Pixel centres lie at whole numbers; x_px counts columns, y_px rows. What `reduced` has made is
    kept for the next who asks.
    """

    pixels: NDArray[Any]
    name: str
    _halves: list[NDArray[Any]] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def height_px(self) -> int:
        """Rows."""
        return int(self.pixels.shape[0])

    @property
    def width_px(self) -> int:
        """Columns."""
        return int(self.pixels.shape[1])

    def holds(self, px: NDArray[Any]) -> NDArray[np.bool_]:
        """Which of the places px (n, 2), x and y, lie between the centres of its pixels."""
        last = (self.width_px - 1, self.height_px - 1)
        return np.asarray(((px >= 0) & (px <= last)).all(axis=1))

    def reduced(self, factor: int) -> NDArray[Any]:
        """Pixels at 1 / factor of the size, a power of two: means of whole blocks.

        What is over at the far borders goes.
        """
        levels = [self.pixels, *self._halves]
        for level in range(len(levels), factor.bit_length()):
            finer = levels[level - 1]
            rows, columns = (size // 2 for size in finer.shape[:2])
            whole = finer[: 2 * rows, : 2 * columns]
            levels.append(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))
        self._halves[:] = levels[1:]
        return levels[factor.bit_length() - 1]

    def opponent(self) -> NDArray[Any]:
        """float32 (rows, columns, 3): lightness 0-255, red - green, yellow - blue.

        Grey photos have one channel only, shape (rows, columns, 1).
        """
        return opponent(self.pixels)

    def as_bgr8(self) -> NDArray[np.uint8]:
        """A copy for drawing, uint8 (rows, columns, 3)."""
        pixels = self.pixels if self.pixels.dtype == np.uint8 else (self.pixels >> 8)
        whole = cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if pixels.ndim == 2 else pixels
        return np.array(whole, dtype=np.uint8)


def opponent(pixels: NDArray[Any]) -> NDArray[np.float32]:
    """uint8 or uint16 pixels as float32 (rows, columns, 3 or 1): see `Photo.opponent`."""
    scale = np.float32(1 / 257 if pixels.dtype == np.uint16 else 1)
    if pixels.ndim == 2:
        return np.asarray(pixels, dtype=np.float32)[..., None] * scale
    return np.asarray(cv2.transform(np.asarray(pixels, dtype=np.float32), OPPONENT * scale))


def load_photo(path: Path, limits: Limits = LIMITS) -> Photo:
    """Read a photo file; `ImageError` if it is no whole picture, `LimitExceeded` if too large."""
    if not path.is_file():
        raise ImageError(f"{path}: no such photo; check the name")
    return decode_photo(path.read_bytes(), str(path), limits)


def decode_photo(data: bytes, name: str, limits: Limits = LIMITS) -> Photo:
    """Decode a photo: the header's size is checked first, the orientation flag is obeyed.

    Alpha is left out; palettes become colours; depths other than 8 and 16 bit are refused.
    """
    if not data:
        raise ImageError(f"{name} is empty; copy the file again")
    header = check_picture(data, name, limits)
    if min(header.width_px, header.height_px) < _SMALLEST_PX:
        size = f"{header.width_px} x {header.height_px} px"
        raise ImageError(f"{name} has {size}: nothing can be measured in it")
    _check_whole(data, name, header)
    flags = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR
    try:
        pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error as error:
        raise ImageError(f"{name} cannot be decoded: {error.err}; copy the file again") from error
    if pixels is None:
        raise ImageError(f"{name} cannot be decoded; it is damaged or cut: copy the file again")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ImageError(f"{name} holds {pixels.dtype} pixels; save it with 8 or 16 bit")
    return make_photo(pixels, name)


def _check_whole(data: bytes, name: str, header: PictureHeader) -> None:
    """Refuse a JPEG or PNG without its end: decoders fill the missing part with grey."""
    ends = {"image/jpeg": b"\xff\xd9", "image/png": b"IEND"}
    end = ends.get(header.media_type)
    body = data.rfind(b"\xff\xda") if header.media_type == "image/jpeg" else 0
    if end is not None and data.find(end, max(body, 0)) < 0:
        raise ImageError(
            f"{name} ends at byte {len(data)} in the middle of the picture; copy the file again"
        )


def make_photo(pixels: NDArray[Any], name: str) -> Photo:
    """A photo from decoded uint8 or uint16 pixels; three equal channels become one."""
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[..., 0]
    if pixels.ndim == 3 and _is_grey(pixels):
        pixels = np.ascontiguousarray(pixels[..., 0])
    return Photo(pixels, name)


def _is_grey(pixels: NDArray[Any]) -> bool:
    first = pixels[..., 0]
    return bool((first == pixels[..., 1]).all() and (first == pixels[..., 2]).all())
