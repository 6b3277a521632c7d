"""Message definitions (ros2msg) and their CDR layout (XCDR1, little endian).

A CDR payload is a 4-byte header (00 01 00 00) and the fields, each aligned to its own size
counted from behind that header (OMG DDSI-RTPS 2.5, section 10).
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

from seamlog.channels import CAMERA_INFO_SCHEMA, CHANNELS, IMAGE_SCHEMA, Channel

CDR_HEADER = b"\x00\x01\x00\x00"
CDR_HEADER_INT = int.from_bytes(CDR_HEADER, "little")

PRIMITIVES = {
    "bool": "?",
    "uint8": "B",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float32": "f",
    "float64": "d",
}
"""ROS 2 primitive type to `struct` code; `string` is the only other one."""

TIME = "builtin_interfaces/Time"

_IMAGE_FRONT, _IMAGE_SIZE = struct.Struct("<IiI"), struct.Struct("<I")
_SEPARATOR = "=" * 80
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_TIME = "int32 sec\nuint32 nanosec\n"
_REGION = "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
_CAMERA_INFO = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n"
    "float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\n"
    "uint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"
)
_STANDARD = {
    IMAGE_SCHEMA: (
        "std_msgs/Header header\nstring format\nuint8[] data\n",
        ("std_msgs/Header", "builtin_interfaces/Time"),
    ),
    CAMERA_INFO_SCHEMA: (
        _CAMERA_INFO,
        ("std_msgs/Header", "builtin_interfaces/Time", "sensor_msgs/RegionOfInterest"),
    ),
}
_PARTS = {
    "std_msgs/Header": _HEADER,
    "builtin_interfaces/Time": _TIME,
    "sensor_msgs/RegionOfInterest": _REGION,
}


def definition(channel: Channel) -> str:
    """The ros2msg text of a channel's message, with the definitions it needs."""
    if channel.schema in _STANDARD:
        text, parts = _STANDARD[channel.schema]
        return text + "".join(f"{_SEPARATOR}\nMSG: {part}\n{_PARTS[part]}" for part in parts)
    constants = "".join(f"{kind} {name}={value}\n" for kind, name, value in channel.constants)
    return constants + "".join(f"{field.type} {field.name}\n" for field in channel.fields)


@dataclass(frozen=True, slots=True)
class Layout:
    """Layout of a fixed-width message behind its CDR header.

    `codes` is a `struct` format body with pad bytes, one code per value (arrays count as n
    values); `offsets` are bytes from the start of the payload (CDR header included); `size` is
    the payload's.
    """

    names: tuple[str, ...]
    codes: str
    offsets: tuple[int, ...]
    kinds: tuple[str, ...]
    size: int

    def numpy_fields(self) -> dict[str, tuple[str, int]]:
        """Field name to (numpy format, offset in the payload)."""
        formats = (_numpy_format(kind) for kind in self.kinds)
        return dict(zip(self.names, zip(formats, self.offsets, strict=True), strict=True))


def split_array(kind: str) -> tuple[str, int | None]:
    """`float64[8]` -> (`float64`, 8); `float64` -> (`float64`, None); sequences count as -1."""
    base, bracket, rest = kind.partition("[")
    if not bracket:
        return base, None
    count = rest.rstrip("]")
    return base, int(count) if count.isdigit() else -1


def _numpy_format(kind: str) -> str:
    base, count = split_array(kind)
    code = {"?": "?", "B": "u1", "b": "i1"}.get(PRIMITIVES[base])
    if code is None:
        code = "<" + {"H": "u2", "h": "i2", "I": "u4", "i": "i4", "Q": "u8", "q": "i8"}.get(
            PRIMITIVES[base], "f4" if base == "float32" else "f8"
        )
    return f"({count},){code}" if count else code


def is_fixed(channel: Channel) -> bool:
    """True if each message of the channel has the same length."""
    kinds = [split_array(field.type) for field in channel.fields]
    return bool(kinds) and all(base in PRIMITIVES and count != -1 for base, count in kinds)


def layout(topic: str) -> Layout:
    """Layout of a fixed-width topic of the table; `KeyError` for an unknown topic."""
    return layout_of(CHANNELS[topic])


@cache
def layout_of(channel: Channel) -> Layout:
    """Layout of the fixed-width messages of `channel`, which need not be in the table."""
    if not is_fixed(channel):
        raise ValueError(f"{channel.topic}: {channel.schema} has no fixed width")
    codes, offsets, at = "", [], 0
    for field in channel.fields:
        base, count = split_array(field.type)
        code = PRIMITIVES[base]
        width = struct.calcsize("<" + code)
        pad = -at % width
        codes += "x" * pad + code * (count or 1)
        offsets.append(len(CDR_HEADER) + at + pad)
        at += pad + width * (count or 1)
    kinds = tuple(field.type for field in channel.fields)
    return Layout(channel.field_names, codes, tuple(offsets), kinds, len(CDR_HEADER) + at)


class CdrWriter:
    """Builds one CDR payload field by field."""

    def __init__(self) -> None:
        self._data = bytearray(CDR_HEADER)

    def put(self, kind: str, value: Any) -> None:
        """Append a value of ROS 2 type `kind`: a primitive, `string`, array or sequence of them.

        A `builtin_interfaces/Time` is given as nanoseconds since 1970.
        """
        if kind == TIME:
            seconds, nanoseconds = divmod(value, 1_000_000_000)
            self._one("int32", seconds)
            self._one("uint32", nanoseconds)
            return
        base, count = split_array(kind)
        if count is None:
            self._one(base, value)
            return
        if count == -1:
            self._one("uint32", len(value))
        elif len(value) != count:
            raise ValueError(f"{kind} needs {count} values, got {len(value)}")
        self._many(base, value)

    def _align(self, width: int) -> None:
        self._data.extend(bytes(-(len(self._data) - len(CDR_HEADER)) % width))

    def _one(self, base: str, value: Any) -> None:
        if base == "string":
            text = value.encode()
            self._one("uint32", len(text) + 1)
            self._data += text + b"\x00"
            return
        code = "<" + PRIMITIVES[base]
        self._align(struct.calcsize(code))
        self._data += struct.pack(code, value)

    def _many(self, base: str, values: Sequence[Any] | bytes) -> None:
        if isinstance(values, bytes | bytearray | memoryview) and base in ("uint8", "byte"):
            self._data += values
            return
        if base == "string":
            for value in values:
                self._one(base, value)
            return
        if len(values):
            self._align(struct.calcsize("<" + PRIMITIVES[base]))
        self._data += struct.pack(f"<{len(values)}{PRIMITIVES[base]}", *values)

    def payload(self) -> bytes:
        """The finished payload with its CDR header."""
        return bytes(self._data)


def encode(channel: Channel, values: Sequence[Any]) -> bytes:
    """CDR payload of a message; `values` in the order of the table."""
    writer = CdrWriter()
    for field, value in zip(channel.fields, values, strict=True):
        writer.put(field.type, value)
    return writer.payload()


def encode_image(stamp_ns: int, frame_id: str, image_format: str, data: bytes) -> bytes:
    """CDR payload of a sensor_msgs/msg/CompressedImage."""
    return image_head(stamp_ns, frame_id, image_format, len(data)) + data


def image_head(stamp_ns: int, frame_id: str, image_format: str, size: int) -> bytes:
    """What stands in front of the `size` bytes of the picture in a CompressedImage payload."""
    names = _image_names(frame_id, image_format)
    front = _IMAGE_FRONT.pack(CDR_HEADER_INT, *divmod(stamp_ns, 1_000_000_000))
    return front + names + _IMAGE_SIZE.pack(size)


@lru_cache(64)
def _image_names(frame_id: str, image_format: str) -> bytes:
    """The two strings behind the stamp, up to where the size stands."""
    writer = CdrWriter()
    for kind, value in ((TIME, 0), ("string", frame_id), ("string", image_format), ("uint32", 0)):
        writer.put(kind, value)
    return writer.payload()[_IMAGE_FRONT.size : -_IMAGE_SIZE.size]
