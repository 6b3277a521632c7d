"""Pictures: the size from the header before anything is decoded, then pixels within the limits."""

import struct
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from seamlog.errors import ImageError, LimitExceeded
from seamlog.limits import LIMITS, Limits

_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_BARE = frozenset({0x01, *range(0xD0, 0xD9)})
_TIFF_SIZES = {256: "width", 257: "height"}


@dataclass(frozen=True, slots=True)
class PictureHeader:
    """What a picture file says about itself."""

    media_type: str
    width_px: int
    height_px: int


def picture_header(data: bytes | memoryview, where: str) -> PictureHeader:
    """Kind and size of a JPEG, PNG, TIFF or BMP; `ImageError` for anything else."""
    data = memoryview(data)
    for magic, media_type, size_of in _KINDS:
        if data[: len(magic)] == magic:
            try:
                width, height = size_of(data)
            except (struct.error, IndexError, KeyError) as error:
                raise ImageError(f"{where}: the {media_type} is cut or damaged") from error
            if width < 1 or height < 1:
                raise ImageError(f"{where}: the {media_type} declares {width} x {height} pixels")
            return PictureHeader(media_type, width, height)
    raise ImageError(f"{where} is no JPEG, PNG, TIFF or BMP picture")


def check_picture(data: bytes | memoryview, where: str, limits: Limits = LIMITS) -> PictureHeader:
    """The header, if the picture is within `limits`; else `LimitExceeded`."""
    header = picture_header(data, where)
    pixels = header.width_px * header.height_px
    if pixels > limits.image_pixels:
        raise LimitExceeded(
            f"{where} declares {header.width_px} x {header.height_px} = {pixels} pixels, more "
            f"than the limit image_pixels = {limits.image_pixels}"
        )
    return header


def decode_picture(data: bytes | memoryview, where: str, limits: Limits = LIMITS) -> NDArray[Any]:
    """Pixels, uint8, shape (rows, columns) grey or (rows, columns, 3) BGR."""
    import cv2
    import numpy as np

    check_picture(data, where, limits)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_ANYCOLOR)
    if image is None:
        raise ImageError(f"{where}: the picture cannot be decoded; it is cut or damaged")
    return image


def _jpeg_size(data: memoryview) -> tuple[int, int]:
    at = 2
    while True:
        while data[at] != 0xFF:
            raise IndexError("no marker")
        while data[at] == 0xFF:
            at += 1
        marker = data[at]
        at += 1
        if marker in _JPEG_BARE:
            continue
        if marker in _JPEG_FRAMES:
            height, width = struct.unpack_from(">HH", data, at + 3)
            return width, height
        at += max(struct.unpack_from(">H", data, at)[0], 2)


def _png_size(data: memoryview) -> tuple[int, int]:
    width, height = struct.unpack_from(">II", data, 16)
    return width, height


def _bmp_size(data: memoryview) -> tuple[int, int]:
    width, height = struct.unpack_from("<ii", data, 18)
    return width, abs(height)


def _tiff_size(data: memoryview) -> tuple[int, int]:
    order = "<" if data[0] == ord("I") else ">"
    (directory,) = struct.unpack_from(order + "I", data, 4)
    (count,) = struct.unpack_from(order + "H", data, directory)
    found: dict[str, int] = {}
    for place in range(count):
        at = directory + 2 + 12 * place
        tag, kind = struct.unpack_from(order + "HH", data, at)
        if tag in _TIFF_SIZES:
            form = "H" if kind == 3 else "I"
            (found[_TIFF_SIZES[tag]],) = struct.unpack_from(order + form, data, at + 8)
    return found["width"], found["height"]


_KINDS = (
    (b"\xff\xd8\xff", "image/jpeg", _jpeg_size),
    (b"\x89PNG\r\n\x1a\n", "image/png", _png_size),
    (b"II*\x00", "image/tiff", _tiff_size),
    (b"MM\x00*", "image/tiff", _tiff_size),
    (b"BM", "image/bmp", _bmp_size),
)
