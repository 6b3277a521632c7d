"""Messages of varying length: built whole, then copied into their ring."""

import struct
from collections.abc import Callable
from threading import get_ident
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

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
    """

    def __init__(
        self, ring: Ring, gate: Gate, channel_id: int, clock: Clock, encode: Encode, share: float
    ) -> None:
        self._ring = ring
        self._gate = gate
        self._channel_id = channel_id
        self._now, self._anchor = log_time_parts(clock)
        self._encode = encode
        self._share = int(ring.capacity * share)
        self._head = 0
        self._accepted = 0
        self._gaps = 0

    def put(self, stamp_ns: int, *values: Any) -> bool:
        """Log one message, values in the table's order."""
        if get_ident() != self._gate.owner:
            return self._gate.refuse_foreign()
        try:
            start, rest = self._encode(stamp_ns, *values)
            head = self._message_head(stamp_ns, len(start) + len(rest)) + start
        except Exception as error:  # noqa: BLE001 - values of the caller may raise anything
            return self._gate.refuse(f"{type(error).__name__}: {error}")
        return self._store(head, rest)

    def put_frame(self, stamp_ns: int, image: NDArray[Any]) -> bool:
        """Log a picture, uint8, shape (rows, columns) or (rows, columns, 3) BGR: one copy."""
        if get_ident() != self._gate.owner:
            return self._gate.refuse_foreign()
        try:
            pixels, shape = _pixels(image)
            head = self._raw_head(stamp_ns, len(pixels), shape)
        except Exception as error:  # noqa: BLE001 - values of the caller may raise anything
            return self._gate.refuse(f"{type(error).__name__}: {error}")
        return self._store(head, pixels)

    def stop(self) -> None:
        """Take nothing more; the gate is closed already."""

    def _sequence(self) -> int:
        return (self._accepted + self._gaps) % _SEQUENCES

    def _message_head(self, stamp_ns: int, size: int) -> bytes:
        _check_stamp(stamp_ns)
        length = RECORD.size - RECORD_HEAD_BYTES + size
        log_time_ns = self._now() + self._anchor
        return RECORD.pack(
            MESSAGE, length, self._channel_id, self._sequence(), log_time_ns, stamp_ns
        )

    def _raw_head(self, stamp_ns: int, size: int, shape: tuple[int, int, int]) -> bytes:
        _check_stamp(stamp_ns)
        length = RAW_HEAD.size - RECORD_HEAD_BYTES + size
        log_time_ns = self._now() + self._anchor
        return RAW_HEAD.pack(RAW_FRAME, length, self._sequence(), log_time_ns, stamp_ns, *shape)

    def _store(self, head: bytes, rest: Buffer) -> bool:
        size = len(head) + len(rest)
        at = self._reserve(size)
        if at is None:
            return False
        body = at + len(head)
        self._ring.data[at:body] = head
        self._ring.data[body : at + size] = rest
        return self._publish(at, size)

    def _reserve(self, size: int) -> int | None:
        """Offset for a record of `size` bytes, or None if it was turned away."""
        if size > self._share // 2:
            self._gate.refuse(f"the message has {size} bytes, one may have {self._share // 2}")
            return None
        capacity = self._ring.capacity
        rest = capacity - self._head % capacity
        end = self._head + size + (rest if rest < size else 0)
        if self._gate.is_open and (self._fits(end) or self._gate.has_room(lambda: self._fits(end))):
            return self._start(rest, size)
        if not self._gate.is_open:
            self._gate.refuse_closed()
            return None
        self._gaps += 1
        self._gate.drop(self._accepted + self._gaps - 1)
        return None

    def _fits(self, end: int) -> bool:
        return end - int(self._ring.words[TAIL]) <= self._share

    def _start(self, rest: int, size: int) -> int:
        at = self._head % self._ring.capacity
        if rest >= size:
            return at
        self._ring.data[at] = SKIP
        return 0

    def _publish(self, at: int, size: int) -> bool:
        capacity = self._ring.capacity
        skipped = -self._head % capacity if at == 0 else 0
        self._head += skipped + size
        self._ring.words[HEAD] = self._head
        self._accepted += 1
        self._ring.words[ACCEPTED] = self._accepted
        return True


def _check_stamp(stamp_ns: int) -> None:
    if not 0 <= stamp_ns.__index__() < _STAMPS:
        raise ValueError(f"stamp_ns must be from 0 to 2**63 - 1, got {stamp_ns}")


def _pixels(image: Any) -> tuple[memoryview, tuple[int, int, int]]:
    """The bytes of a picture and its rows, columns and samples; `ValueError` if it is none."""
    view = memoryview(image)
    if not view.c_contiguous:
        view = np.ascontiguousarray(image).data
    form = view.shape or ()
    if view.format != "B" or len(form) not in (2, 3) or 0 in form or form[2:] not in ((), (3,)):
        raise ValueError(
            "a picture is uint8 of shape (rows, columns) or (rows, columns, 3), got "
            f"{view.format!r} of shape {form}"
        )
    if max(form) > _LARGEST_PX:
        raise ValueError(f"a picture of {form[1]} x {form[0]} px is larger than JPEG allows")
    return view.cast("B"), (form[0], form[1], form[2] if len(form) == 3 else 1)
