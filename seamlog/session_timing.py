"""How evenly the messages of each topic came, how many bytes they take, and whether all are there.

Read from the message indexes; only chunks without one are unpacked.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import CHANNELS
from seamlog.evenness import Evenness, evenness_of
from seamlog.mcap import records
from seamlog.mcap.file import McapFile
from seamlog.mcap.message_index import read_message_index
from seamlog.mcap.records import ChunkEntry

if TYPE_CHECKING:
    from seamlog.session import Session

_HEAD = struct.Struct("<BQHIQ")
RECORDER = CHANNELS["/seamlog/recorder"]


@dataclass(frozen=True, slots=True)
class Timing:
    """Log times and bytes of a topic; None where there are too few messages.

    `size_bytes` counts unpacked messages with their record heads.
    """

    start_ns: int
    end_ns: int
    rate_hz: float | None
    size_bytes: int
    evenness: Evenness | None


@dataclass(frozen=True, slots=True)
class Account:
    """What the recorder says of a topic at its end."""

    offered: int
    written: int
    dropped: int
    refused: int
    lost: int


def timing_of_topics(session: "Session") -> dict[str, Timing]:
    """Timing of each topic of a session."""
    times: dict[str, list[NDArray[np.int64]]] = {}
    sizes: dict[str, int] = {}
    for file in session.files:
        topics = {row.id: row.topic for row in file.index.channels.values()}
        for entry in file.index.chunks:
            for number, log_times, size in _chunk(file, entry):
                if number in topics:
                    times.setdefault(topics[number], []).append(log_times)
                    sizes[topics[number]] = sizes.get(topics[number], 0) + size
    return {topic: _timing(np.concatenate(parts), sizes[topic]) for topic, parts in times.items()}


def _chunk(file: McapFile, entry: ChunkEntry) -> Iterator[tuple[int, NDArray[np.int64], int]]:
    """Channel, log times and bytes of what is in a chunk."""
    found = {n: read_message_index(file.source, entry, n) for n in entry.index_offsets}
    if not found or any(rows is None for rows in found.values()):
        yield from _unindexed(file, entry)
        return
    rows = {n: np.frombuffer(raw, "<u8").reshape(-1, 2) for n, raw in found.items() if raw}
    if len(rows) == 1:
        for number, table in rows.items():
            yield number, table[:, 0].astype(np.int64), entry.uncompressed_size
        return
    starts = np.sort(np.concatenate([table[:, 1] for table in rows.values()] or [np.empty(0)]))
    ends = np.append(starts[1:], entry.uncompressed_size)
    for number, table in rows.items():
        places = np.searchsorted(starts, table[:, 1])
        size = int(ends[places].sum() - starts[places].sum())
        yield number, table[:, 0].astype(np.int64), size


def _unindexed(file: McapFile, entry: ChunkEntry) -> Iterator[tuple[int, NDArray[np.int64], int]]:
    """By walking over the unpacked chunk, once for all channels."""
    times: dict[int, list[int]] = {}
    sizes: dict[int, int] = {}
    for chunk in file.iter_chunks([entry]):
        at, end = 0, len(chunk.data)
        while at + _HEAD.size <= end:
            opcode, length, number, _, time = _HEAD.unpack_from(chunk.data, at)
            if opcode == records.MESSAGE:
                times.setdefault(number, []).append(time)
                sizes[number] = sizes.get(number, 0) + length + records.RECORD_HEAD.size
            at += length + records.RECORD_HEAD.size
    for number, found in times.items():
        yield number, np.array(found, np.uint64).view(np.int64), sizes[number]


def _timing(times: NDArray[np.int64], size: int) -> Timing:
    times = np.sort(times)
    start, end = int(times[0]), int(times[-1])
    rate = (len(times) - 1) * 1e9 / (end - start) if end > start else None
    return Timing(start, end, rate, size, evenness_of(times))


def accounts(session: "Session") -> dict[str, Account]:
    """The recorder's last word on each topic; empty if the session has no accounts."""
    if session.schema(RECORDER.topic) != RECORDER.schema:
        return {}
    fields = ["topic", "offered", "written", "dropped", "refused", "lost"]
    columns = session.columns(RECORDER.topic, fields)
    rows = zip(*(columns[name].tolist() for name in fields), strict=True)
    return {topic: Account(*counts) for topic, *counts in rows}
