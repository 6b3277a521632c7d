"""Messages of varying length: built whole, then copied into their ring."""

import struct
from collections.abc import Callable
from threading import get_ident
from typing import Any, TypeAlias

import numpy as np

from seamlog.clock import Clock
from seamlog.mcap.records import Buffer

from .fixed import log_time_parts
from .gate import Gate
from .ring import (
    ACCEPTED,
    HEAD,
    MESSAGE,
    RAW_FRAME,
    RECORD,
    RECORD_HEAD_BYTES,
    SKIP,
    TAIL,
    Ring,
)

Encode: TypeAlias = Callable[..., tuple[bytes, Buffer]]
"""From stamp and values to a payload in two parts."""
RAW_HEAD = struct.Struct("<BQIQQIIB")
"""Opcode, length, sequence, log time, stamp, rows, columns, samples per pixel."""
_STAMPS = 1 << 63
_SEQUENCES = 1 << 32
_LARGEST_PX = 65_500


class VaryingWriter:
    """Producer of a ring of whole records.

    `share` is the part of the ring it may fill, half of it with one message (so that one fits
    into an empty ring wherever that begins again).

    A picture comes each 30 ms into a cold cache: what its call touches is what it costs.
    """

    __slots__ = (
        "_anchor",
        "_channel_id",
        "_data",
        "_encode",
        "_gaps",
        "_gate",
        "_is_busy",
        "_known",
        "_limit",
        "_now",
        "_owner",
        "_picture",
        "_ring",
        "_share",
        "_words",
    )

    def __init__(
        self, ring: Ring, gate: Gate, channel_id: int, clock: Clock, encode: Encode, share: float
    ) -> None:
        self._ring = ring
        self._words, self._data = ring.words, ring.data
        self._gate = gate
        self._owner = gate.owner
        self._channel_id = channel_id
        self._now, self._anchor = log_time_parts(clock)
        self._encode = encode
        self._share = self._limit = int(ring.capacity * share)
        """`_limit` is how far `head` may go as far as is known; -1 after the end."""
        self._known = (0, 0)
        """`head` and the count of messages up to there."""
        self._gaps = 0
        self._is_busy = False
        self._picture: tuple[tuple[int, ...], tuple[int, int, int]] = ((), (0, 0, 0))
        """Shape of the last picture, and its rows, columns, samples per pixel."""

    def put(self, stamp_ns: int, *values: Any) -> bool:
        """Log one message, values in the table's order."""
        return self._alone(self._put, stamp_ns, values)

    def put_frame(self, stamp_ns: int, image: Any) -> bool:
        """Log a picture, uint8, shape (rows, columns) or (rows, columns, 3) BGR: one copy."""
        return self._alone(self._put_frame, stamp_ns, image)

    def _alone(self, act: Callable[[int, Any], bool], stamp_ns: int, values: Any) -> bool:
        """Do `act` in the owner's thread, but not in a signal's handler that interrupts another."""
        if get_ident() != self._owner:
            return self._gate.refuse_foreign()
        if self._is_busy:
            return self._gate.refuse("put by a signal's handler while it interrupts a put here")
        self._is_busy = True
        try:
            return act(stamp_ns, values)
        finally:
            self._is_busy = False

    def _put(self, stamp_ns: int, values: tuple[Any, ...]) -> bool:
        try:
            time_ns = self._time_ns(stamp_ns)
            start, rest = self._encode(stamp_ns, *values)
            size = RECORD.size + len(start) + len(rest)
        except Exception as error:  # noqa: BLE001 - values of the caller may raise anything
            return self._gate.refuse(f"{type(error).__name__}: {error}")
        end = self._place(size)
        if end < 0:
            return False
        at = (end - size) % self._ring.capacity
        number = (self._known[1] + self._gaps) % _SEQUENCES
        length = size - RECORD_HEAD_BYTES
        RECORD.pack_into(
            self._data, at, MESSAGE, length, self._channel_id, number, time_ns, stamp_ns
        )
        body = at + RECORD.size + len(start)
        self._data[at + RECORD.size : body] = start
        self._data[body : at + size] = rest
        return self._publish(end)

    def _put_frame(self, stamp_ns: int, image: Any) -> bool:
        try:
            time_ns = self._time_ns(stamp_ns)
            pixels = memoryview(image)
            shape, form = self._picture
            if pixels.shape != shape or pixels.format != "B":
                form = _form_of(pixels)
                self._picture = pixels.shape or (), form
            size = RAW_HEAD.size + pixels.nbytes
        except Exception as error:  # noqa: BLE001 - values of the caller may raise anything
            return self._gate.refuse(f"{type(error).__name__}: {error}")
        end = self._place(size)
        if end < 0:
            return False
        at = (end - size) % self._ring.capacity
        number = (self._known[1] + self._gaps) % _SEQUENCES
        length = size - RECORD_HEAD_BYTES
        RAW_HEAD.pack_into(self._data, at, RAW_FRAME, length, number, time_ns, stamp_ns, *form)
        if pixels.c_contiguous:
            self._data[at + RAW_HEAD.size : at + size] = pixels.cast("B")
        else:
            room = np.frombuffer(self._data, np.uint8, pixels.nbytes, at + RAW_HEAD.size)
            room.reshape(pixels.shape or ())[...] = pixels
        return self._publish(end)

    def stop(self) -> None:
        """Take nothing more; the gate is closed already."""
        self._limit = -1

    def _time_ns(self, stamp_ns: int) -> int:
        """Log time now; `ValueError` if it or the stamp is none."""
        time_ns = self._now() + self._anchor
        if not 0 <= stamp_ns.__index__() < _STAMPS:
            raise ValueError(f"stamp_ns must be from 0 to 2**63 - 1, got {stamp_ns}")
        if not 0 <= time_ns.__index__() < _STAMPS:
            raise ValueError(f"the clock must tell from 0 to 2**63 - 1 ns, it tells {time_ns}")
        return time_ns

    def _place(self, size: int) -> int:
        """`head` behind a record of `size` bytes, -1 if it was turned away."""
        head, capacity = self._known[0], self._ring.capacity
        rest = capacity - head % capacity
        end = head + size if size <= rest else head + rest + size
        if (end > self._limit or size > self._share // 2) and not self._makes_room(size, end):
            return -1
        if size > rest:
            self._data[capacity - rest] = SKIP
        return end

    def _makes_room(self, size: int, end: int) -> bool:
        """Look again how far `head` may go; turns away what has no room."""
        gate, words, share = self._gate, self._words, self._share
        if size > share // 2:
            return gate.refuse(f"the message has {size} bytes, one may have {share // 2}")
        has_room = gate.has_room(lambda: end - words[TAIL] <= share)
        self._limit = words[TAIL] + share
        if not gate.is_open:
            self._limit = -1
            return gate.refuse_closed()
        if not has_room:
            self._gaps += 1
            return gate.drop(self._known[1] + self._gaps - 1)
        return True

    def _publish(self, end: int) -> bool:
        """An interrupt before `HEAD` is stored leaves the message to be published by the next."""
        accepted = self._known[1] + 1
        self._known = end, accepted
        self._words[HEAD] = end
        self._words[ACCEPTED] = accepted
        return True


def _form_of(pixels: memoryview) -> tuple[int, int, int]:
    """Rows, columns and samples per pixel; `ValueError` if these are no pixels of a picture."""
    form = pixels.shape or ()
    if pixels.format != "B" or len(form) not in (2, 3) or 0 in form or form[2:] not in ((), (3,)):
        raise ValueError(
            "a picture is uint8 of shape (rows, columns) or (rows, columns, 3), got "
            f"format {pixels.format!r} of shape {form}"
        )
    if max(form) > _LARGEST_PX:
        raise ValueError(f"a picture of {form[1]} x {form[0]} px is larger than JPEG allows")
    return form[0], form[1], 3 if form[2:] else 1
