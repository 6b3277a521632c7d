"""Messages of varying length: built whole, then copied into their ring."""

import math
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
        "_loan",
        "_loan_head",
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
        self._loan: NDArray[np.uint8] | None = None
        self._loan_head = 0
        """Where `head` was when the loan was made: it stands behind that."""

    def put(self, stamp_ns: int, *values: Any) -> bool:
        """Log one message, values in the table's order."""
        if get_ident() != self._owner or self._is_busy:
            return self._turn_away()
        self._is_busy = True
        try:
            return self._put(stamp_ns, values)
        finally:
            self._is_busy = False

    def put_frame(self, stamp_ns: int, image: Any) -> bool:
        """Log a picture, uint8, shape (rows, columns) or (rows, columns, 3) BGR.

        One copy, none of a picture that stands in a loan.
        """
        if get_ident() != self._owner or self._is_busy:
            return self._turn_away()
        self._is_busy = True
        try:
            return self._put_frame(stamp_ns, image)
        finally:
            self._is_busy = False

    def loan_frame(self, shape: tuple[int, ...]) -> NDArray[np.uint8]:
        """Room in the ring to read a picture of `shape` into; where there is none, other memory."""
        size = RAW_HEAD.size + math.prod(shape)
        end = self._end(size)
        if (
            get_ident() != self._owner
            or self._is_busy
            or ((end > self._limit or size > self._share // 2) and not self._may_lend(size, end))
        ):
            return np.empty(shape, np.uint8)
        at = (end - size) % self._ring.capacity + RAW_HEAD.size
        self._loan = room = np.ndarray(shape, np.uint8, self._data, at)
        self._loan_head = self._known[0]
        return room

    def _turn_away(self) -> bool:
        """A call of another thread, or of a signal's handler that interrupts one."""
        if get_ident() != self._owner:
            return self._gate.refuse_foreign()
        return self._gate.refuse("put by a signal's handler while it interrupts a put here")

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
            is_loan = image is self._loan
            if is_loan and self._loan_head != self._known[0]:
                raise ValueError("other messages of this channel were put over the loaned picture")
        except Exception as error:  # noqa: BLE001 - values of the caller may raise anything
            return self._gate.refuse(f"{type(error).__name__}: {error}")
        end = self._place(size)
        if end < 0:
            return False
        at = (end - size) % self._ring.capacity
        number = (self._known[1] + self._gaps) % _SEQUENCES
        length = size - RECORD_HEAD_BYTES
        RAW_HEAD.pack_into(self._data, at, RAW_FRAME, length, number, time_ns, stamp_ns, *form)
        if is_loan:
            self._loan = None
            image.setflags(write=False)
        elif pixels.c_contiguous:
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
        capacity, end = self._ring.capacity, self._end(size)
        if (end > self._limit or size > self._share // 2) and not self._makes_room(size, end):
            return -1
        if end - size > self._known[0]:
            self._data[self._known[0] % capacity] = SKIP
        return end

    def _end(self, size: int) -> int:
        """`head` behind a record of `size` bytes, which does not go around the ring's end."""
        head, capacity = self._known[0], self._ring.capacity
        rest = capacity - head % capacity
        return head + size if size <= rest else head + rest + size

    def _may_lend(self, size: int, end: int) -> bool:
        """Look again how far `head` may go; counts nothing, as nothing was offered yet."""
        self._limit = self._words[TAIL] + self._share if self._gate.is_open else -1
        return size <= self._share // 2 and end <= self._limit

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
