"""The hot path: messages of one width, packed into their slot by one call.

Opcode, length and channel id stand in each slot from the start; one precompiled `struct` packs
sequence, times and the CDR payload behind them. The count of messages is the whole state, so
that neither an exception nor an interrupt between two instructions can leave it inconsistent.
"""

import itertools
import math
import struct
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from threading import get_ident
from typing import Any, TypeAlias

import numpy as np

from seamlog.clock import Clock, MonotonicClock
from seamlog.messages import CDR_HEADER_INT, Layout, split_array

from .gate import Gate
from .ring import HEAD, MESSAGE, TAIL, Ring, create_ring

Put: TypeAlias = Callable[..., bool]

_FRONT = struct.Struct("<BQH")
_BODY = "<IQQI"
"""Sequence, log time, publish time, CDR header; the fields follow."""
RING_BYTES = 2 << 20
_SEQUENCES = 1 << 32


def _body(layout: Layout) -> struct.Struct:
    return struct.Struct(_BODY + layout.codes)


def fixed_ring(path: Path, channel_id: int, layout: Layout) -> Ring:
    """A ring for messages of `layout`, the unchanging front of each slot written."""
    size = _body(layout).size
    stride = _FRONT.size + size
    ring = create_ring(path, RING_BYTES, stride)
    front = _FRONT.pack(MESSAGE, stride - 9, channel_id)
    slots = np.frombuffer(ring.data, np.uint8).reshape(-1, stride)
    slots[:, : _FRONT.size] = np.frombuffer(front, np.uint8)
    return ring


def log_time_parts(clock: Clock) -> tuple[Callable[[], int], int]:
    """A function and a number whose sum is log time, the cheapest way this clock allows."""
    if type(clock) is MonotonicClock:
        return time.monotonic_ns, clock.anchor_ns
    return clock.now_ns, 0


def fixed_put(ring: Ring, gate: Gate, layout: Layout, clock: Clock) -> tuple[Put, Put]:
    """`put(stamp_ns, *values)` for a ring of `fixed_ring`, and a function that ends it."""
    pack_into = _body(layout).pack_into
    words, slots, stride = ring.words, ring.slots, ring.stride
    bodies = ring.data[_FRONT.size :]
    now, anchor = log_time_parts(clock)
    owner = gate.owner
    number, gaps, limit = 0, 0, slots

    def put(stamp_ns: int, *values: Any) -> bool:
        nonlocal number
        if (number >= limit or get_ident() != owner) and not admit():
            return False
        at = number % slots * stride
        try:
            front = (bodies, at, number + gaps, now() + anchor, stamp_ns, CDR_HEADER_INT, stamp_ns)
            pack_into(*(front + values))
        except Exception as error:  # noqa: BLE001 - values of the caller may raise anything
            return explain(stamp_ns, values, error)
        number += 1
        words[HEAD] = number
        return True

    def admit() -> bool:
        nonlocal gaps, limit
        if get_ident() != owner:
            return gate.refuse_foreign()
        if gate.is_open and gate.has_room(fits):
            return True
        if not gate.is_open:
            limit = -1
            return gate.refuse_closed()
        gaps += 1
        return gate.drop(number + gaps - 1)

    def fits() -> bool:
        nonlocal limit
        limit = words[TAIL] + slots
        return number < limit

    def explain(stamp_ns: Any, values: tuple[Any, ...], error: Exception) -> bool:
        nonlocal gaps
        if number + gaps >= _SEQUENCES:
            gaps -= _SEQUENCES
            return put(stamp_ns, *values)
        return gate.refuse(_reason(layout.names, (stamp_ns, *values), error))

    def stop() -> bool:
        nonlocal limit
        gate.is_open = False
        limit = -1
        return True

    return put, stop


def flattened(put: Put, gate: Gate, layout: Layout) -> Put:
    """`put` for messages with arrays: each is one value, short ones are filled up with NaN."""
    counts = [split_array(kind)[1] for kind in layout.kinds]

    def put_arrays(stamp_ns: int, *values: Any) -> bool:
        try:
            pairs = zip(counts[1:], values, strict=True)
            parts = [(value,) if n is None else _filled(value, n) for n, value in pairs]
        except (TypeError, ValueError) as error:
            return gate.refuse(_reason(layout.names, (stamp_ns, *values), error))
        return put(stamp_ns, *itertools.chain.from_iterable(parts))

    return put_arrays


def _filled(values: Iterable[float], count: int) -> list[float]:
    found = list(values)
    if len(found) > count:
        raise ValueError(f"{len(found)} values where {count} fit")
    return found + [math.nan] * (count - len(found))


def _reason(names: tuple[str, ...], values: tuple[Any, ...], error: Exception) -> str:
    wanted = ", ".join(names)
    got = ", ".join(_short(value) for value in values)
    return f"put({wanted}) cannot take ({got}): {error}"


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001 - it is the caller's object
        text = f"<{type(value).__name__}>"
    return text if len(text) <= 40 else text[:37] + "..."
