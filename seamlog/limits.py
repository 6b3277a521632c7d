"""One object with all limits of reading, so that no input can take the machine down."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Upper bounds, in bytes unless the name says otherwise."""

    chunk_bytes: int = 256 << 20
    """Decompressed size of one chunk; counted while decompressing."""
    message_bytes: int = 64 << 20
    attachment_bytes: int = 512 << 20
    image_pixels: int = 120_000_000
    """Width times height, taken from the picture's header before it is decoded."""
    summary_bytes: int = 256 << 20
    expansion: int = 200
    """Bytes that all chunks may unpack to per byte of the file, once they are more than
    `chunk_bytes`: logs of machines come to 2 to 50."""


LIMITS = Limits()
