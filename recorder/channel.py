"""A channel of the live loop: the writer that fits its topic, over a ring of its own."""

import threading
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from seamlog import plugins
from seamlog.channels import CAMERA_INFO_SCHEMA, CHANNELS, IMAGE_SCHEMA
from seamlog.channels import Channel as Row
from seamlog.clock import Clock
from seamlog.errors import UsageError
from seamlog.messages import encode, encode_image, is_fixed, layout

from .camera_info import encode_camera_info
from .fixed import RING_BYTES, Put, fixed_put, fixed_ring, flattened
from .folder import OutTray
from .gate import Gate
from .ring import Ring, create_ring
from .varying import VaryingWriter

_FRAME_RING_BYTES = 64 << 20
_SMALL_FRAME_RING_BYTES = 16 << 20
"""Where shared memory is scarce, as in containers with 64 MiB of it."""
_FRAME_SHARE = 0.75
FIRST_CHANNEL_ID = 3
"""Channels 1 and 2 are the recorder's own."""


class Channel:
    """One topic of a recording, owned by the thread that asked for it."""

    __slots__ = ("_clock", "_names", "_put_frame", "gate", "metadata", "put", "stop", "topic")

    def __init__(
        self, topic: str, metadata: Mapping[str, str], clock: Clock, gate: Gate, writer: "_Writer"
    ) -> None:
        self.topic = topic
        self.metadata = metadata
        self.gate = gate
        self.put, self.stop, self._put_frame = writer
        self._clock = clock
        self._names = CHANNELS[topic].field_names[1:]

    def log(self, stamp_ns: int | None, fields: Mapping[str, Any]) -> bool:
        """Log one message by field names; without a stamp, now."""
        if stamp_ns is None:
            stamp_ns = self._clock.now_ns()
        try:
            values = [fields[name] for name in self._names]
        except KeyError as missing:
            return self.gate.refuse(f"field {missing} is missing")
        if len(values) != len(fields):
            return self.gate.refuse(plugins.unknown_name("field", *self._stranger(fields)))
        return self.put(stamp_ns, *values)

    def _stranger(self, fields: Mapping[str, Any]) -> tuple[str, list[str]]:
        stranger = next(name for name in fields if name not in self._names)
        return stranger, list(self._names)

    def put_frame(self, stamp_ns: int | None, image: NDArray[Any]) -> bool:
        """Log a picture that the recorder process is to encode."""
        if self._put_frame is None:
            return self.gate.refuse("pictures go to a topic of pictures only")
        return self._put_frame(self._clock.now_ns() if stamp_ns is None else stamp_ns, image)


_Writer = tuple[Put, Put, Put | None]


def known_row(topic: str) -> Row:
    """The row of `topic` in the channel table; `UsageError` lists the known topics."""
    if topic not in CHANNELS:
        raise UsageError(plugins.unknown_name("topic", topic, list(CHANNELS)))
    if topic == "/seamlog/recorder":
        raise UsageError(f"{topic} is written by the recorder itself")
    return CHANNELS[topic]


def make_channel(
    topic: str,
    metadata: Mapping[str, str],
    tray: OutTray,
    clock: Clock,
    gate_to: Callable[[str, Ring], Gate],
    number: int,
) -> Channel:
    """Make the ring of a channel, hand it to the recorder process and build its writer."""
    row = known_row(topic)
    path = tray.next_path(".ring")
    channel_id = FIRST_CHANNEL_ID + number
    if is_fixed(row):
        ring = fixed_ring(path, channel_id, layout(topic))
        gate = gate_to(topic, ring)
        writer = _fixed_writer(row, ring, gate, clock)
    else:
        ring = _varying_ring(path, row)
        gate = gate_to(topic, ring)
        writer = _varying_writer(row, ring, gate, channel_id, clock)
    tray.place(
        {
            "kind": "channel",
            "topic": topic,
            "channel_id": channel_id,
            "ring": path.name,
            "metadata": dict(metadata),
        }
    )
    return Channel(topic, metadata, clock, gate, writer)


def producer_name() -> str:
    """Who logs: the thread's name, `main` for the first."""
    thread = threading.current_thread()
    return "main" if thread is threading.main_thread() else thread.name


def _fixed_writer(row: Row, ring: Ring, gate: Gate, clock: Clock) -> _Writer:
    form = layout(row.topic)
    put, stop = fixed_put(ring, gate, form, clock)
    if any("[" in kind for kind in form.kinds):
        put = flattened(put, gate, form)
    return put, stop, None


def _varying_ring(path: Path, row: Row) -> Ring:
    if row.schema != IMAGE_SCHEMA:
        return create_ring(path, RING_BYTES, 0)
    from os import statvfs

    facts = statvfs(path.parent)
    plenty = facts.f_bavail * facts.f_frsize >= 4 * _FRAME_RING_BYTES
    return create_ring(path, _FRAME_RING_BYTES if plenty else _SMALL_FRAME_RING_BYTES, 0)


def _varying_writer(row: Row, ring: Ring, gate: Gate, channel_id: int, clock: Clock) -> _Writer:
    is_picture = row.schema == IMAGE_SCHEMA
    share = _FRAME_SHARE if is_picture else 1.0
    writer = VaryingWriter(ring, gate, channel_id, clock, _encoder(row), share)
    return writer.put, writer.stop, writer.put_frame if is_picture else None


def _encoder(row: Row) -> Callable[..., bytes]:
    if row.schema == IMAGE_SCHEMA:
        return encode_image
    if row.schema == CAMERA_INFO_SCHEMA:
        return encode_camera_info
    return partial(_encode_own, row)


def _encode_own(row: Row, *values: Any) -> bytes:
    return encode(row, values)
