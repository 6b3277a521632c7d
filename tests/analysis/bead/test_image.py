"""Loading photos: depths, colours, orientation, damage, size."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seamlog.analysis.bead.image import decode_photo, load_photo
from seamlog.errors import ImageError, InputError, LimitExceeded

RNG = np.random.default_rng(0)
GREY = RNG.integers(0, 255, (40, 60), dtype=np.uint8)
COLOUR = RNG.integers(0, 255, (40, 60, 3), dtype=np.uint8)


def encoded(suffix: str, pixels: np.ndarray) -> bytes:
    return cv2.imencode(suffix, pixels)[1].tobytes()


@pytest.mark.parametrize("suffix", [".png", ".tiff", ".bmp"])
@pytest.mark.parametrize("pixels", [GREY, COLOUR], ids=["grey", "colour"])
def test_lossless_files_come_back(suffix: str, pixels: np.ndarray) -> None:
    photo = decode_photo(encoded(suffix, pixels), "a")
    assert (photo.width_px, photo.height_px) == (60, 40)
    assert (photo.pixels == pixels).all()


def test_sixteen_bits_keep_their_depth() -> None:
    pixels = RNG.integers(0, 65535, (40, 60), dtype=np.uint16)
    photo = decode_photo(encoded(".png", pixels), "a")
    assert photo.pixels.dtype == np.uint16
    assert photo.opponent()[..., 0] == pytest.approx(pixels / 257, abs=0.01)


def test_alpha_is_left_out() -> None:
    pixels = np.dstack([COLOUR, np.full((40, 60), 7, np.uint8)])
    assert (decode_photo(encoded(".png", pixels), "a").pixels == COLOUR).all()


def test_equal_channels_become_grey() -> None:
    photo = decode_photo(encoded(".png", np.dstack([GREY] * 3)), "a")
    assert photo.pixels.ndim == 2
    assert photo.opponent().shape == (40, 60, 1)


def with_orientation(jpeg: bytes, orientation: int) -> bytes:
    tiff = b"II*\x00\x08\x00\x00\x00" + struct.pack("<HHHIHHI", 1, 0x112, 3, 1, orientation, 0, 0)
    exif = b"Exif\x00\x00" + tiff
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]


def test_orientation_flag_is_obeyed() -> None:
    jpeg = encoded(".jpg", np.full((40, 60), 90, np.uint8))
    assert decode_photo(with_orientation(jpeg, 6), "a").pixels.shape == (60, 40)
    assert decode_photo(with_orientation(jpeg, 1), "a").pixels.shape == (40, 60)
    assert decode_photo(with_orientation(jpeg, 99), "a").pixels.shape == (40, 60)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("kept", [0.3, 0.7, 0.98])
def test_a_cut_file_is_refused(suffix: str, kept: float) -> None:
    data = encoded(suffix, COLOUR)
    with pytest.raises(ImageError, match="a"):
        decode_photo(data[: int(kept * len(data))], "a")


def test_huge_header_is_refused_before_decoding() -> None:
    header = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 2, 0, 0, 0)
    chunk = (
        struct.pack(">I", 13) + b"IHDR" + header + struct.pack(">I", zlib.crc32(b"IHDR" + header))
    )
    with pytest.raises(LimitExceeded, match="60000 x 60000"):
        decode_photo(b"\x89PNG\r\n\x1a\n" + chunk, "a")


@pytest.mark.parametrize("data", [b"", b"hello", b"%PDF-1.7", b"\xff\xd8", b"RIFF1234WEBP"])
def test_no_picture(data: bytes) -> None:
    with pytest.raises(ImageError):
        decode_photo(data, "a")


def test_missing_file_and_tiny_picture(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match="no such photo"):
        load_photo(tmp_path / "none.jpg")
    with pytest.raises(ImageError, match="nothing can be measured"):
        decode_photo(encoded(".png", GREY[:8, :8]), "a")


@settings(max_examples=60, deadline=None)
@given(
    suffix=st.sampled_from([".jpg", ".png", ".tiff", ".bmp"]),
    place=st.floats(0, 1),
    junk=st.binary(min_size=1, max_size=12),
    cut=st.floats(0.2, 1),
)
def test_damage_is_an_input_error_or_a_picture(
    suffix: str, place: float, junk: bytes, cut: float
) -> None:
    data = bytearray(encoded(suffix, COLOUR))
    at = int(place * (len(data) - 1))
    data[at : at + len(junk)] = junk
    try:
        photo = decode_photo(bytes(data[: int(cut * len(data))]), "a")
    except InputError as error:
        assert "a" in str(error)
    else:
        assert photo.pixels.dtype in (np.uint8, np.uint16)
