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
_LARGE_BYTES = 64 << 10
_UINT8 = np.dtype(np.uint8)


class VaryingWriter:
    """Producer of a ring of whole records.

    `share` is the part of the ring it may fill, half of it with one message (so that one fits
    into an empty ring wherever that begins again).

    The store of `head` publishes a message. What is known besides follows from it, so that an
    interrupt between any two instructions leaves nothing to repair but `_known`, see `_place`.
    """

    __slots__ = (
        "_anchor",
        "_channel_id",
        "_data",
        "_encode",
        "_gaps",
        "_gate",
        "_known",
        "_now",
        "_owner",
        "_ring",
        "_shape",
        "_share",
        "_views",
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
        self._share = int(ring.capacity * share)
        self._known = (0, 0)
        """`head` and the count of messages up to there."""
        self._gaps = 0
        self._shape: tuple[int, ...] = ()
        self._views: dict[int, NDArray[np.uint8]] = {}

    def put(self, stamp_ns: int, *values: Any) -> bool:
        """Log one message, values in the table's order."""
        if get_ident() != self._owner:
            return self._gate.refuse_foreign()
        try:
            time_ns = self._now() + self._anchor
            _check_times(stamp_ns, time_ns)
            start, rest = self._encode(stamp_ns, *values)
            size = RECORD.size + len(start) + len(rest)
        except Exception as error:  # noqa: BLE001 - values of the caller may raise anything
            return self._gate.refuse(f"{type(error).__name__}: {error}")
        at = self._place(size)
        if at < 0:
            return False
        number = (self._known[1] + self._gaps) % _SEQUENCES
        length = size - RECORD_HEAD_BYTES
        RECORD.pack_into(
            self._data, at, MESSAGE, length, self._channel_id, number, time_ns, stamp_ns
        )
        body = at + RECORD.size + len(start)
        self._data[at + RECORD.size : body] = start
        self._data[body : at + size] = rest
        return self._publish(at, size)

    def put_frame(self, stamp_ns: int, image: Any) -> bool:
        """Log a picture, uint8, shape (rows, columns) or (rows, columns, 3) BGR: one copy."""
        if get_ident() != self._owner:
            return self._gate.refuse_foreign()
        try:
            time_ns = self._now() + self._anchor
            _check_times(stamp_ns, time_ns)
            if image.__class__ is not np.ndarray:
                image = np.asarray(memoryview(image))
            if image.dtype != _UINT8:
                _check_picture(image)
            shape = image.shape
            if shape != self._shape:
                _check_picture(image)
                self._shape, self._views = shape, {}
        except Exception as error:  # noqa: BLE001 - values of the caller may raise anything
            return self._gate.refuse(f"{type(error).__name__}: {error}")
        size = RAW_HEAD.size + image.size
        at = self._place(size)
        if at < 0:
            return False
        number = (self._known[1] + self._gaps) % _SEQUENCES
        length = size - RECORD_HEAD_BYTES
        form = shape if len(shape) == 3 else (*shape, 1)
        RAW_HEAD.pack_into(self._data, at, RAW_FRAME, length, number, time_ns, stamp_ns, *form)
        view = self._views.get(at)
        if view is None:
            view = self._view(at, image.size)
        view[...] = image
        return self._publish(at, size)

    def stop(self) -> None:
        """Take nothing more; the gate is closed already."""

    def _view(self, at: int, size: int) -> NDArray[np.uint8]:
        """Where the pixels of a record at `at` go; kept, as a ring comes round again and again."""
        pixels = np.frombuffer(self._data, np.uint8, size, at + RAW_HEAD.size)
        view = pixels.reshape(self._shape)
        if size >= _LARGE_BYTES:
            self._views[at] = view
        return view

    def _place(self, size: int) -> int:
        """Offset for a record of `size` bytes, -1 if it was turned away."""
        head, accepted = self._known
        if self._words[HEAD] != head:
            # An interrupt came between publishing a message and counting it.
            head = self._count(int(self._words[HEAD]), accepted + 1)
        if size > self._share // 2:
            self._gate.refuse(f"the message has {size} bytes, one may have {self._share // 2}")
            return -1
        at = head % self._ring.capacity
        rest = self._ring.capacity - at
        end = head + size + (rest if rest < size else 0)
        fits = self._gate.is_open and end - self._words[TAIL] <= self._share
        if not (fits or self._gate.has_room(lambda: end - self._words[TAIL] <= self._share)):
            return self._turn_away()
        if rest >= size:
            return at
        self._data[at] = SKIP
        return 0

    def _turn_away(self) -> int:
        if not self._gate.is_open:
            self._gate.refuse_closed()
            return -1
        self._gaps += 1
        self._gate.drop(self._known[1] + self._gaps - 1)
        return -1

    def _publish(self, at: int, size: int) -> bool:
        head, accepted = self._known
        end = head + size + (-head % self._ring.capacity if at == 0 else 0)
        self._words[HEAD] = end
        self._count(end, accepted + 1)
        return True

    def _count(self, head: int, accepted: int) -> int:
        self._words[ACCEPTED] = accepted
        self._known = (head, accepted)
        return head


def _check_times(stamp_ns: int, log_time_ns: int) -> None:
    if not 0 <= stamp_ns.__index__() < _STAMPS:
        raise ValueError(f"stamp_ns must be from 0 to 2**63 - 1, got {stamp_ns}")
    if not 0 <= log_time_ns.__index__() < _STAMPS:
        raise ValueError(f"the clock must tell from 0 to 2**63 - 1 ns, it tells {log_time_ns}")


def _check_picture(image: NDArray[Any]) -> None:
    form = image.shape
    if image.dtype != _UINT8 or len(form) not in (2, 3) or 0 in form or form[2:] not in ((), (3,)):
        raise ValueError(
            "a picture is uint8 of shape (rows, columns) or (rows, columns, 3), got "
            f"{image.dtype} of shape {form}"
        )
    if max(form) > _LARGEST_PX:
        raise ValueError(f"a picture of {form[1]} x {form[0]} px is larger than JPEG allows")
