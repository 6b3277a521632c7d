"""Size of a picture from its header alone, so that a huge one is refused before it is decoded."""

import struct

from seamlog.errors import ImageError

_STANDALONE = frozenset({0x01, *range(0xD0, 0xD9)})
_NOT_FRAMES = frozenset({0xC4, 0xC8, 0xCC})
_TIFF_FORMATS = {1: "B", 3: "H", 4: "I"}


def picture_size(data: bytes, where: str) -> tuple[int, int]:
    """Width and height in px of a JPEG, PNG, TIFF, WebP or BMP file; `where` names it in errors.

    Raises `ImageError` for another kind of file and for one that ends before its picture does.
    """
    for magic, reader in _READERS:
        if data.startswith(magic):
            try:
                return reader(data)
            except (struct.error, IndexError, KeyError) as error:
                raise ImageError(_cut(where, len(data))) from error
            except ValueError as error:
                raise ImageError(f"{where}: {error}; copy the file again") from error
    if not data:
        raise ImageError(f"{where} is empty; copy the file again")
    raise ImageError(
        f"{where} is no picture that can be read (JPEG, PNG, TIFF, WebP, BMP); convert it first"
    )


def _cut(where: str, length: int) -> str:
    return f"{where} ends at byte {length} in the middle of the picture; copy the file again"


def _png(data: bytes) -> tuple[int, int]:
    width, height = struct.unpack(">II", data[16:24])
    if b"IEND" not in data[-4096:]:
        raise IndexError
    return width, height


def _bmp(data: bytes) -> tuple[int, int]:
    width, height = struct.unpack("<ii", data[18:26])
    if len(data) < struct.unpack("<I", data[2:6])[0]:
        raise IndexError
    return abs(width), abs(height)


def _webp(data: bytes) -> tuple[int, int]:
    if data[8:12] != b"WEBP":
        raise ValueError("a RIFF file that holds no WebP picture")
    if len(data) < struct.unpack("<I", data[4:8])[0] + 8:
        raise IndexError
    kind = data[12:16]
    if kind == b"VP8 ":
        width, height = struct.unpack("<HH", data[26:30])
        return width & 0x3FFF, height & 0x3FFF
    if kind == b"VP8L":
        bits = struct.unpack("<I", data[21:25])[0]
        return (bits & 0x3FFF) + 1, ((bits >> 14) & 0x3FFF) + 1
    width = int.from_bytes(data[24:27], "little") + 1
    return width, int.from_bytes(data[27:30], "little") + 1


def _jpeg(data: bytes) -> tuple[int, int]:
    size = None
    at = 2
    while True:
        while data[at] == 0xFF and data[at + 1] == 0xFF:
            at += 1
        if data[at] != 0xFF:
            raise ValueError(f"no JPEG marker at byte {at}")
        marker = data[at + 1]
        if marker in _STANDALONE:
            at += 2
            continue
        length = struct.unpack(">H", data[at + 2 : at + 4])[0]
        if 0xC0 <= marker <= 0xCF and marker not in _NOT_FRAMES:
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            size = (width, height)
        at += 2 + length
        if marker == 0xDA:
            break
    if size is None:
        raise ValueError("a JPEG file without a frame header")
    if data.find(b"\xff\xd9", at) < 0:
        raise IndexError
    return size


def _tiff(data: bytes) -> tuple[int, int]:
    order = "<" if data[:2] == b"II" else ">"
    start = struct.unpack(order + "I", data[4:8])[0]
    count = struct.unpack(order + "H", data[start : start + 2])[0]
    values: dict[int, int] = {}
    for entry in range(count):
        at = start + 2 + 12 * entry
        tag, kind = struct.unpack(order + "HH", data[at : at + 4])
        if tag in (256, 257):
            code = _TIFF_FORMATS[kind]
            size = struct.calcsize(code)
            values[tag] = struct.unpack(order + code, data[at + 8 : at + 8 + size])[0]
    return values[256], values[257]


_READERS = (
    (b"\xff\xd8", _jpeg),
    (b"\x89PNG\r\n\x1a\n", _png),
    (b"II*\x00", _tiff),
    (b"MM\x00*", _tiff),
    (b"RIFF", _webp),
    (b"BM", _bmp),
)
