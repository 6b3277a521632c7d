"""Packs many messages at once into Message records."""

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import Channel
from seamlog.errors import UsageError
from seamlog.mcap import records
from seamlog.mcap.rows import PAYLOAD
from seamlog.messages import CDR_HEADER_INT, layout_of

MESSAGE_HEAD = struct.Struct("<BQHIQQ")


class RecordTemplate:
    """Message records of a fixed-width channel as a numpy structured array, heads filled in."""

    def __init__(self, channel: Channel, channel_id: int) -> None:
        try:
            layout = layout_of(channel)
        except ValueError as error:
            raise UsageError(f"{error}; use write_payloads") from error
        self._fields = layout.numpy_fields()
        self.stride = PAYLOAD + layout.size
        self._kind = _record_kind(self._fields, self.stride)
        self._rows = np.zeros(0, self._kind)
        self._channel_id = channel_id

    def checked(self, topic: str, columns: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        """The columns as arrays; `UsageError` if one is missing, unknown or of another kind."""
        if set(columns) != set(self._fields):
            raise UsageError(
                f"{topic} needs the fields {', '.join(self._fields)}; got {', '.join(columns)}"
            )
        ready = {}
        for name, (form, _) in self._fields.items():
            ready[name] = _fitting(f"{topic}: {name}", np.asarray(columns[name]), np.dtype(form))
        lengths = {name: len(column) for name, column in ready.items()}
        if len(set(lengths.values())) != 1:
            raise UsageError(f"{topic}: columns of different lengths: {lengths}")
        return ready

    def pack(
        self,
        columns: Mapping[str, NDArray[Any]],
        log_times_ns: NDArray[np.int64],
        part: slice,
        first_sequence: int,
    ) -> tuple[memoryview, NDArray[np.uint64]]:
        """Records of the rows `part` and their offsets; valid until the next call."""
        times = log_times_ns[part]
        if len(self._rows) < len(times):
            self._rows = self._blank(len(times))
        rows = self._rows[: len(times)]
        rows["log_time"] = rows["publish_time"] = times
        start = (first_sequence + part.start) & 0xFFFFFFFF
        rows["sequence"] = np.arange(start, start + len(times), dtype=np.uint64)
        for name in self._fields:
            rows["=" + name] = columns[name][part]
        offsets = np.arange(0, rows.nbytes, self.stride, dtype=np.uint64)
        return rows.view(np.uint8).data, offsets

    def _blank(self, count: int) -> NDArray[Any]:
        rows = np.zeros(count, self._kind)
        rows["opcode"], rows["length"] = records.MESSAGE, self.stride - records.RECORD_HEAD.size
        rows["channel"], rows["cdr"] = self._channel_id, CDR_HEADER_INT
        return rows


def _record_kind(fields: Mapping[str, tuple[str, int]], stride: int) -> np.dtype[Any]:
    head = {
        "opcode": ("u1", 0),
        "length": ("<u8", 1),
        "channel": ("<u2", 9),
        "sequence": ("<u4", 11),
        "log_time": ("<u8", 15),
        "publish_time": ("<u8", 23),
        "cdr": ("<u4", PAYLOAD),
    }
    body = {"=" + name: (form, PAYLOAD + offset) for name, (form, offset) in fields.items()}
    both = head | body
    return np.dtype(
        {
            "names": list(both),
            "formats": [form for form, _ in both.values()],
            "offsets": [offset for _, offset in both.values()],
            "itemsize": stride,
        }
    )


def _fitting(where: str, column: NDArray[Any], kind: np.dtype[Any]) -> NDArray[Any]:
    if column.shape[1:] != kind.shape or column.ndim == 0:
        raise UsageError(f"{where} has shape {column.shape}, wanted (n, {kind.shape}) without ()")
    base = kind.base
    if column.dtype == base:
        return column
    if column.dtype.kind not in {"f": "fiub", "b": "b"}.get(base.kind, "iub"):
        raise UsageError(f"{where} is {column.dtype}, which does not fit {base}")
    packed = column.astype(base)
    if base.kind in "iu" and not (packed == column).all():
        raise UsageError(f"{where} holds values outside {base}")
    return packed


def payload_records(
    payloads: Sequence[bytes],
    log_times_ns: NDArray[np.int64],
    part: slice,
    channel_id: int,
    first_sequence: int,
) -> tuple[bytes, NDArray[np.uint64]]:
    """Message records of ready payloads, and their offsets."""
    pieces, offsets, at = [], [], 0
    rows = zip(payloads[part], log_times_ns[part].tolist(), strict=True)
    for place, (payload, time) in enumerate(rows, first_sequence + part.start):
        length = MESSAGE_HEAD.size - records.RECORD_HEAD.size + len(payload)
        sequence = place & 0xFFFFFFFF
        pieces += [
            MESSAGE_HEAD.pack(records.MESSAGE, length, channel_id, sequence, time, time),
            payload,
        ]
        offsets.append(at)
        at += records.RECORD_HEAD.size + length
    return b"".join(pieces), np.array(offsets, np.uint64)
