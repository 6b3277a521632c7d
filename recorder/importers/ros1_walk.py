"""Walks over a ROS 1 bag record by record, for bags without an index or with a lost end."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from seamlog.errors import ImportFailed

_MAGIC = b"#ROSBAG V2.0\n"
_SIZE = struct.Struct("<I")
_MESSAGE, _BAG, _CHUNK, _CONNECTION = b"\x02", b"\x03", b"\x05", b"\x07"
_LARGEST_CHUNK = 1 << 30


@dataclass
class Walk:
    """Messages of a bag in file order; `stopped` says where the rest could not be read."""

    data: memoryview
    stopped: str = ""
    _connections: dict[bytes, Any] = field(default_factory=dict)

    def messages(self) -> Iterator[tuple[Any, int, bytes]]:
        """Connection (topic, msgtype, msgdef.data), time in ns, and payload of each message."""
        if self.data[: len(_MAGIC)] != _MAGIC:
            raise ImportFailed("it does not begin as a bag of version 2.0")
        try:
            head, _, _ = _record(self.data, len(_MAGIC))
        except (struct.error, ValueError) as error:
            raise ImportFailed(f"its first record cannot be read: {error}") from error
        if head.get(b"op") != _BAG:
            raise ImportFailed("its first record is no head of a bag")
        yield from self._records(self.data, len(_MAGIC), 0)

    def _records(self, data: memoryview, at: int, base: int) -> Iterator[tuple[Any, int, bytes]]:
        while at < len(data):
            try:
                head, start, end = _record(data, at)
            except (struct.error, ValueError) as error:
                self.stopped = self.stopped or f"from byte {base + at} on: {error}"
                return
            at = end
            try:
                yield from self._content(head, data[start : min(end, len(data))], base + start)
            except (struct.error, ValueError, KeyError) as error:
                self.stopped = self.stopped or f"the record at byte {base + start}: {error}"
            if end > len(data):
                cut = f"the record at byte {base + start} is cut"
                self.stopped = self.stopped or cut

    def _content(
        self, head: dict[bytes, bytes], data: memoryview, base: int
    ) -> Iterator[tuple[Any, int, bytes]]:
        kind = head.get(b"op")
        if kind == _CONNECTION:
            told = dict(_fields(bytes(data)))
            definition = SimpleNamespace(data=told[b"message_definition"].decode())
            self._connections[head[b"conn"]] = SimpleNamespace(
                topic=head[b"topic"].decode(), msgtype=_name(told[b"type"]), msgdef=definition
            )
        elif kind == _MESSAGE and head[b"conn"] in self._connections:
            seconds, rest = struct.unpack("<II", head[b"time"])
            yield self._connections[head[b"conn"]], seconds * 10**9 + rest, bytes(data)
        elif kind == _CHUNK:
            try:
                unpacked = _unpacked(bytes(data), head)
            except (ValueError, OSError, RuntimeError, EOFError) as error:
                self.stopped = self.stopped or f"the chunk at byte {base}: {error}"
                return
            yield from self._records(memoryview(unpacked), 0, base)


def _record(data: memoryview, at: int) -> tuple[dict[bytes, bytes], int, int]:
    (size,) = _SIZE.unpack_from(data, at)
    head = dict(_fields(bytes(data[at + 4 : at + 4 + size])))
    (length,) = _SIZE.unpack_from(data, at + 4 + size)
    start = at + 8 + size
    if head.get(b"op") == _MESSAGE and start + length > len(data):
        raise ValueError("a message is cut")
    return head, start, start + length


def _fields(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 0
    while at < len(data):
        (size,) = _SIZE.unpack_from(data, at)
        name, sign, value = data[at + 4 : at + 4 + size].partition(b"=")
        if not sign or len(name) + len(value) + 1 != size:
            raise ValueError("a record's head is damaged")
        yield name, value
        at += 4 + size


def _name(name: bytes) -> str:
    package, _, message = name.decode().partition("/")
    return f"{package}/msg/{message}"


def _unpacked(data: bytes, head: dict[bytes, bytes]) -> bytes:
    kind, (size,) = head.get(b"compression"), _SIZE.unpack(head[b"size"])
    if size > _LARGEST_CHUNK:
        raise ValueError(f"it declares {size} bytes")
    if kind == b"none":
        return data
    if kind == b"bz2":
        from bz2 import BZ2Decompressor

        return BZ2Decompressor().decompress(data, size)
    if kind == b"lz4":
        from lz4.frame import LZ4FrameDecompressor

        return bytes(LZ4FrameDecompressor().decompress(data, size))
    raise ValueError(f"its compression {kind!r} is unknown")
