"""A channel of the live loop: the writer that fits its topic, over a ring of its own."""

import os
import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog import plugins
from seamlog.channels import CHANNELS, IMAGE_SCHEMA
from seamlog.channels import Channel as Row
from seamlog.clock import Clock
from seamlog.errors import UsageError
from seamlog.messages import encode, is_fixed, layout

from .fixed import RING_BYTES, fixed_put, fixed_ring
from .folder import OutTray
from .gate import Gate
from .pictures import picture_payload
from .put_source import Put, PutNamed, Stop
from .ring import Ring, create_ring
from .varying import Encode, VaryingWriter

_FRAME_RING_BYTES = 128 << 20
_SMALL_FRAME_RING_BYTES = 16 << 20
"""Where shared memory is scarce, as in containers with 64 MiB of it."""
_FRAME_SHARE = 0.75
FIRST_CHANNEL_ID = 3
"""Channels 1 and 2 are the recorder's own."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One topic of a recording, owned by the thread that asked for it."""

    topic: str
    metadata: Mapping[str, str]
    put: Put
    """`put(stamp_ns, *values) -> bool`, values in the table's order."""
    put_named: PutNamed
    put_frame: Callable[[int, NDArray[Any]], bool]
    loan_frame: Callable[[tuple[int, ...]], NDArray[np.uint8]]
    stop: Stop
    """Take nothing more."""
    gate: Gate

    def refuse_names(self, fields: Collection[str]) -> bool:
        """Refuse a message whose fields are not the topic's."""
        wanted = ", ".join(CHANNELS[self.topic].field_names)
        return self.gate.refuse(f"fields are {wanted}; got {', '.join(fields)}")


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
    """Make the ring of a channel, hand it to the recorder process and build its writer.

    `number` is the one of its item in the tray.
    """
    row = known_row(topic)
    path = tray.next_path(".ring")
    channel_id = FIRST_CHANNEL_ID + number - 1
    if is_fixed(row):
        ring = fixed_ring(path, channel_id, layout(topic))
        gate = gate_to(topic, ring)
        put, put_named, stop = fixed_put(ring, gate, layout(topic), clock)
        pictures = _no_pictures(gate), _no_loan
        channel = Channel(topic, metadata, put, put_named, *pictures, stop, gate)
    else:
        ring = _varying_ring(path, row)
        gate = gate_to(topic, ring)
        channel = _varying_channel(row, metadata, ring, gate, channel_id, clock)
    tray.place(
        {
            "kind": "channel",
            "topic": topic,
            "channel_id": channel_id,
            "ring": path.name,
            "metadata": dict(metadata),
        }
    )
    return channel


def producer_name() -> str:
    """Who logs: the thread's name, `main` for the first."""
    thread = threading.current_thread()
    return "main" if thread is threading.main_thread() else thread.name


def _named(put: Put, topic: str) -> PutNamed:
    """`put` by field names for one that takes values in the table's order."""
    names = CHANNELS[topic].field_names[1:]

    def put_named(stamp_ns: int, fields: Mapping[str, Any]) -> bool:
        if set(fields) != set(names):
            raise TypeError(f"{topic} has the fields {names}")
        return put(stamp_ns, *(fields[name] for name in names))

    return put_named


def _no_pictures(gate: Gate) -> Callable[[int, NDArray[Any]], bool]:
    return lambda _stamp_ns, _image: gate.refuse("pictures go to a topic of pictures only")


def _no_loan(shape: tuple[int, ...]) -> NDArray[np.uint8]:
    return np.empty(shape, np.uint8)


def _varying_ring(path: Path, row: Row) -> Ring:
    if row.schema != IMAGE_SCHEMA:
        return create_ring(path, RING_BYTES, 0)
    facts = os.statvfs(path.parent)
    plenty = facts.f_bavail * facts.f_frsize >= 4 * _FRAME_RING_BYTES
    return create_ring(path, _FRAME_RING_BYTES if plenty else _SMALL_FRAME_RING_BYTES, 0)


def _varying_channel(
    row: Row, metadata: Mapping[str, str], ring: Ring, gate: Gate, channel_id: int, clock: Clock
) -> Channel:
    is_picture = row.schema == IMAGE_SCHEMA
    share = _FRAME_SHARE if is_picture else 1.0
    writer = VaryingWriter(ring, gate, channel_id, clock, _encoder(row), share)
    put_frame = writer.put_frame if is_picture else _no_pictures(gate)
    loan_frame = writer.loan_frame if is_picture else _no_loan
    named = _named(writer.put, row.topic)
    return Channel(row.topic, metadata, writer.put, named, put_frame, loan_frame, writer.stop, gate)


def _encoder(row: Row) -> Encode:
    if row.schema == IMAGE_SCHEMA:
        return picture_payload
    return lambda *values: (encode(row, values), b"")
