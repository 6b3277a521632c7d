"""Frames of a serial line: bytes in, values by name out; what is no frame is counted."""

import re
import struct
from collections.abc import Callable, Iterator
from typing import Annotated, Literal, Protocol

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from .values import Frame

_LONGEST = 1 << 16
"""Bytes without a frame that are kept at most."""


class FrameReader(Protocol):
    """Takes the bytes as they come."""

    bad: int
    """Frames that were damaged."""
    example: str
    """The first damaged one."""

    def feed(self, data: bytes) -> Iterator[tuple[Frame, int]]:
        """Whole frames so far, each with the number of bytes that have come behind it."""
        ...


class AsciiFrame(BaseModel):
    """Lines of text; `pattern` is a regular expression with a named group per value."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Literal["ascii"] = "ascii"
    terminator: str = Field("\n", min_length=1)
    pattern: str

    @field_validator("pattern")
    @classmethod
    def _has_groups(cls, pattern: str) -> str:
        try:
            groups = re.compile(pattern).groupindex
        except re.error as error:
            raise ValueError(f"no regular expression: {error}") from error
        if not groups:
            raise ValueError("name its values, as in (?P<position>[-+0-9.]+)")
        return pattern

    @property
    def names(self) -> tuple[str, ...]:
        """Names of a frame's values."""
        return tuple(re.compile(self.pattern).groupindex)

    def reader(self) -> "AsciiReader":
        """A reader for such frames."""
        return AsciiReader(self)


class AsciiReader:
    """Splits lines and matches each as a whole."""

    def __init__(self, frame: AsciiFrame) -> None:
        self._end = frame.terminator.encode()
        self._pattern = re.compile(frame.pattern)
        self._rest = b""
        self._is_synced = False
        self.bad, self.example = 0, ""

    def feed(self, data: bytes) -> Iterator[tuple[Frame, int]]:
        """Whole lines so far; the first may have begun before we listened and does not count."""
        *lines, self._rest = (self._rest + data).split(self._end)
        behind = sum(len(line) + len(self._end) for line in lines) + len(self._rest)
        self._rest = self._rest[-_LONGEST:]
        for line in lines:
            behind -= len(line) + len(self._end)
            values = self._values(line.decode("latin-1").strip("\r\n"))
            if values is not None:
                yield values, behind
            self._is_synced = True

    def _values(self, line: str) -> Frame | None:
        match = self._pattern.fullmatch(line)
        try:
            if match is not None:
                return {name: float(text) for name, text in match.groupdict().items()}
        except (TypeError, ValueError):
            pass
        if self._is_synced and line:
            self.bad += 1
            self.example = self.example or repr(line[:80])
        return None


class BinaryFrame(BaseModel):
    """Frames of bytes: `sync` in hexadecimal, then `layout` (Python's struct), then the checksum.

    The checksum covers the layout's bytes, with `checksum_from_sync` those of `sync` as well.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Literal["binary"] = "binary"
    sync: str
    layout: str
    names: tuple[str, ...] = Field(min_length=1)
    checksum: Literal["none", "sum8", "xor8", "crc16-modbus", "crc16-ccitt"] = "none"
    checksum_from_sync: bool = False

    @field_validator("sync")
    @classmethod
    def _is_hex(cls, sync: str) -> str:
        if not bytes.fromhex(sync):
            raise ValueError("at least one byte in hexadecimal, such as aa55")
        return sync

    @model_validator(mode="after")
    def _names_fit(self) -> "BinaryFrame":
        try:
            count = len(struct.unpack(self.layout, bytes(struct.calcsize(self.layout))))
        except struct.error as error:
            raise ValueError(f"layout {self.layout!r}: {error}") from error
        if count != len(self.names):
            raise ValueError(f"layout {self.layout!r} has {count} values, names {len(self.names)}")
        return self

    def reader(self) -> "BinaryReader":
        """A reader for such frames."""
        return BinaryReader(self)


class BinaryReader:
    """Finds frames by their sync bytes and keeps those whose checksum fits."""

    def __init__(self, frame: BinaryFrame) -> None:
        self._sync = bytes.fromhex(frame.sync)
        self._layout = struct.Struct(frame.layout)
        self._names = frame.names
        self._sum, width = _CHECKSUMS[frame.checksum]
        self._from = 0 if frame.checksum_from_sync else len(self._sync)
        self._body = len(self._sync) + self._layout.size
        self._size = self._body + width
        self._rest = b""
        self.bad, self.example = 0, ""

    def feed(self, data: bytes) -> Iterator[tuple[Frame, int]]:
        """Whole frames so far."""
        buffer, at = self._rest + data, 0
        while True:
            at = buffer.find(self._sync, at)
            if at < 0 or at + self._size > len(buffer):
                break
            whole = buffer[at : at + self._size]
            if self._sum(whole[self._from : self._body]) != whole[self._body :]:
                self.bad += 1
                self.example = self.example or whole.hex(" ")
                at += 1
                continue
            at += self._size
            values = self._layout.unpack_from(whole, len(self._sync))
            yield dict(zip(self._names, values, strict=True)), len(buffer) - at
        self._rest = buffer[at:] if at >= 0 else buffer[-(len(self._sync) - 1) :]
        if at < 0 and len(self._sync) == 1:
            self._rest = b""


def _crc16(data: bytes, value: int, polynomial: int, reflected: bool) -> int:
    for byte in data:
        value ^= byte if reflected else byte << 8
        for _ in range(8):
            if reflected:
                value = value >> 1 ^ (polynomial if value & 1 else 0)
            else:
                value = (value << 1 ^ (polynomial if value & 0x8000 else 0)) & 0xFFFF
    return value


def crc16_modbus(data: bytes) -> bytes:
    """CRC-16 of Modbus, low byte first (Modbus over serial line 1.02, section 6.2.2)."""
    return _crc16(data, 0xFFFF, 0xA001, reflected=True).to_bytes(2, "little")


def crc16_ccitt(data: bytes) -> bytes:
    """CRC-16 with polynomial 0x1021 from 0xFFFF, high byte first."""
    return _crc16(data, 0xFFFF, 0x1021, reflected=False).to_bytes(2, "big")


def _xor8(data: bytes) -> bytes:
    value = 0
    for byte in data:
        value ^= byte
    return bytes([value])


_CHECKSUMS: dict[str, tuple[Callable[[bytes], bytes], int]] = {
    "none": (lambda _: b"", 0),
    "sum8": (lambda data: bytes([sum(data) & 0xFF]), 1),
    "xor8": (_xor8, 1),
    "crc16-modbus": (crc16_modbus, 2),
    "crc16-ccitt": (crc16_ccitt, 2),
}

SerialFrame = Annotated[AsciiFrame | BinaryFrame, Field(discriminator="kind")]
