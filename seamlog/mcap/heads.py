"""Heads of all messages of an unpacked chunk: channel, sequence and times as columns."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap import records
from seamlog.mcap.records import Malformed

HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
"""The fixed front of a Message record, 31 bytes."""


def message_heads(data: memoryview) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """Offsets in `data` and heads (dtype `HEAD`) of its messages, in order.

    Raises `Malformed` unless whole records fill `data`.
    """
    at, end, unpack = 0, len(data), records.RECORD_HEAD.unpack_from
    found: list[int] = []
    while at + records.RECORD_HEAD.size <= end:
        opcode, length = unpack(data, at)
        step = length + records.RECORD_HEAD.size
        if opcode == records.MESSAGE:
            if step < HEAD.itemsize:
                raise Malformed(f"the message at byte {at} of a chunk has no head")
            if not found and (end - at) % step == 0 and _is_uniform(data, at, step):
                count = (end - at) // step
                return np.arange(at, end, step), np.ndarray((count,), HEAD, data, at, (step,))
            found.append(at)
        at += step
    if at != end:
        raise Malformed("its records do not fill it")
    offsets = np.array(found, np.int64)
    if not found:
        return offsets, np.empty(0, HEAD)
    windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(data, np.uint8), HEAD.itemsize)
    return offsets, windows[offsets].reshape(-1).view(HEAD)


def _is_uniform(data: memoryview, start: int, step: int) -> bool:
    """True if from `start` on there is nothing but messages of `step` bytes."""
    heads = np.ndarray(((len(data) - start) // step,), HEAD, data, start, (step,))
    is_message = heads["opcode"] == records.MESSAGE
    same = heads["length"] == step - records.RECORD_HEAD.size
    return bool(is_message.all() and same.all())
