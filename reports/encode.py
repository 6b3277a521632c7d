"""Columns as text for the page: differences of whole ticks, bytes by weight, gzip, base64.

A column is stored at the sensor's resolution where the values show one (a power of ten), else at
a small fraction of the typical step from sample to sample, so that no zoom shows the rounding.
The page decodes it in `assets/decode.js`; `decode` is the same in Python.
"""

import base64
import math
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

_LARGEST_TICK = 2**31 - 1
_FINEST_DECIMALS = 12
_TICKS_PER_STEP = 8.0
_TICKS_PER_RANGE = 20_000.0
_GZIP = 31
"""Window bits that make zlib write and read the gzip container."""
_PROBE = 64
"""Values looked at before a resolution is tested on all of them."""


class Encoded(BaseModel):
    """One column: value = (offset + tick) / 10**decimals; bit i of `gaps` set: no value.

    Ticks are stored as differences modulo 2**32, the first from zero, with the sign in the lowest
    bit (0, -1, 1, -2... as 0, 1, 2, 3...), so that small steps of either sign have small bytes.
    """

    model_config = ConfigDict(frozen=True)

    n: int
    decimals: int
    offset: int
    data: str
    gaps: str | None = None


def encode(values: NDArray[Any]) -> Encoded:
    """Encode a one-dimensional column; what is not finite becomes a gap."""
    column = np.asarray(values, dtype=np.float64)
    known = np.isfinite(column)
    gaps = None if known.all() else _pack(np.packbits(~known, bitorder="little"))
    filled = _fill(column, known)
    decimals = _decimals(filled)
    whole = np.rint(_scaled(filled, decimals))
    offset = int(whole.min() + (whole.max() - whole.min()) // 2) if whole.size else 0
    ticks = (whole - offset).astype(np.int32)
    steps = np.diff(ticks, prepend=np.int32(0)).astype(np.int32)
    signed = (steps << 1) ^ (steps >> 31)
    data = _pack(np.ascontiguousarray(signed.astype("<i4").view(np.uint8).reshape(-1, 4).T))
    return Encoded(n=column.size, decimals=decimals, offset=offset, data=data, gaps=gaps)


def decode(encoded: Encoded) -> NDArray[np.float64]:
    """The column again, NaN where there was no value."""
    planes = np.frombuffer(_unpack(encoded.data), np.uint8).reshape(4, encoded.n)
    signed = np.ascontiguousarray(planes.T).view("<u4").ravel()
    steps = (signed >> 1).astype(np.int32) ^ -(signed & 1).astype(np.int32)
    ticks = np.cumsum(steps, dtype=np.int32)
    values = _scaled(ticks.astype(np.float64) + encoded.offset, -encoded.decimals)
    if encoded.gaps is not None:
        bits = np.frombuffer(_unpack(encoded.gaps), np.uint8)
        values[np.unpackbits(bits, bitorder="little")[: encoded.n] == 1] = np.nan
    return values


def _fill(column: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Gaps filled with the last value before them (the first known one at the start)."""
    if known.all():
        return column
    if not known.any():
        return np.zeros_like(column)
    last = np.maximum.accumulate(np.where(known, np.arange(column.size), -1))
    last[last < 0] = int(np.argmax(known))
    return column[last]


def _decimals(values: NDArray[np.float64]) -> int:
    """Decimals of one tick; as few as the values need, never more than int32 holds."""
    if values.size == 0:
        return 0
    span = float(np.ptp(values)) or abs(float(values[0])) or 1.0
    largest = math.floor(math.log10(_LARGEST_TICK / span))
    for decimals in range(min(largest, _FINEST_DECIMALS) + 1):
        if _lies_on_ticks(values[:_PROBE], decimals) and _lies_on_ticks(values, decimals):
            return decimals
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0]
    typical = float(np.median(steps)) if steps.size else span
    tick = min(typical / _TICKS_PER_STEP, span / _TICKS_PER_RANGE)
    return min(math.ceil(-math.log10(tick)), largest)


def _lies_on_ticks(values: NDArray[np.float64], decimals: int) -> bool:
    nearest = _scaled(np.rint(_scaled(values, decimals)), -decimals)
    return bool(np.all(np.abs(nearest - values) <= 4 * np.spacing(np.abs(values))))


def _scaled(values: NDArray[np.float64], decimals: int) -> NDArray[np.float64]:
    """`values` times 10**decimals, by a division where that is the exact way."""
    return values * 10.0**decimals if decimals >= 0 else values / 10.0**-decimals


def _pack(data: NDArray[np.uint8]) -> str:
    """Gzip (no time in its header), tuned for small numbers rather than repeated strings."""
    coder = zlib.compressobj(6, zlib.DEFLATED, _GZIP, zlib.DEF_MEM_LEVEL, zlib.Z_FILTERED)
    return base64.b64encode(coder.compress(data.tobytes()) + coder.flush()).decode()


def _unpack(text: str) -> bytes:
    return zlib.decompress(base64.b64decode(text), _GZIP)
