"""Messages of one width: the ring, and the `put` that packs them into their slots.

Opcode, length and channel id stand in each slot from the start; one precompiled `struct` packs
sequence, times and the CDR payload behind them.
"""

import itertools
import math
import struct
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from seamlog.clock import Clock, MonotonicClock
from seamlog.messages import Layout, split_array

from .gate import Gate
from .put_source import Put, PutNamed, Stop, put_maker
from .ring import MESSAGE, RECORD_HEAD_BYTES, Ring, create_ring

RING_BYTES = 2 << 20
_FRONT = struct.Struct("<BQH")
_BODY = "<IQQI"
"""Sequence, log time, publish time, CDR header; the fields follow."""


def _body(layout: Layout) -> struct.Struct:
    return struct.Struct(_BODY + layout.codes)


def fixed_ring(path: Path, channel_id: int, layout: Layout, capacity: int = RING_BYTES) -> Ring:
    """A ring for messages of `layout`, the unchanging front of each slot written."""
    stride = _FRONT.size + _body(layout).size
    ring = create_ring(path, capacity, stride)
    front = _FRONT.pack(MESSAGE, stride - RECORD_HEAD_BYTES, channel_id)
    slots = np.frombuffer(ring.data, np.uint8).reshape(-1, stride)
    slots[:, : _FRONT.size] = np.frombuffer(front, np.uint8)
    return ring


def log_time_parts(clock: Clock) -> tuple[Callable[[], int], int]:
    """A function and a number whose sum is log time, the cheapest way this clock allows."""
    if type(clock) is MonotonicClock:
        return time.monotonic_ns, clock.anchor_ns
    return clock.now_ns, 0


def fixed_put(ring: Ring, gate: Gate, layout: Layout, clock: Clock) -> tuple[Put, PutNamed, Stop]:
    """`put(stamp_ns, *values)` for a ring of `fixed_ring`, the same by names, what ends both."""
    now, anchor = log_time_parts(clock)
    bodies = ring.data[_FRONT.size :]
    pack_into = _body(layout).pack_into
    make = put_maker(layout)
    put, put_named, stop = make(
        pack_into, bodies, ring.words, ring.slots, ring.stride, now, anchor, gate.owner, gate
    )
    if any("[" in kind for kind in layout.kinds):
        put = _flattened(put, gate, layout)
        return put, lambda stamp_ns, fields: put(stamp_ns, **fields), stop
    return put, put_named, stop


def _flattened(put: Put, gate: Gate, layout: Layout) -> Put:
    """`put` for messages with arrays: each is one value, short ones are filled up with NaN."""
    names = layout.names
    counts = [split_array(kind)[1] for kind in layout.kinds[1:]]

    def put_arrays(stamp_ns: int, *values: Any, **fields: Any) -> bool:
        try:
            given = values or [fields.pop(name) for name in names[1:]]
            pairs = zip(counts, given, strict=True)
            parts = [(value,) if n is None else _filled(value, n) for n, value in pairs]
        except (KeyError, TypeError, ValueError) as error:
            return gate.refuse_values((stamp_ns, *values), error)
        return put(stamp_ns, *itertools.chain.from_iterable(parts), **fields)

    return put_arrays


def _filled(values: Iterable[float], count: int) -> list[float]:
    found = list(values)
    if len(found) > count:
        raise ValueError(f"{len(found)} values where {count} fit")
    return found + [math.nan] * (count - len(found))
