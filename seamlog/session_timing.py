"""How evenly the messages of each topic came, how many bytes they take, and whether all are there.

Read from the message indexes; only chunks without one are unpacked.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import CHANNELS
from seamlog.mcap.file import McapFile
from seamlog.mcap.message_index import read_message_index
from seamlog.mcap.records import ChunkEntry

if TYPE_CHECKING:
    from seamlog.session import Session

RECORDER = CHANNELS["/seamlog/recorder"]


@dataclass(frozen=True, slots=True)
class Timing:
    """Evenness of a topic by log times; figures are None where there are too few messages.

    A gap is a step above 1.5 usual periods (the median); jitter is half the range that 90 % of the
    other steps lie in. `size_bytes` counts unpacked messages with their record heads.
    """

    start_ns: int | None
    end_ns: int | None
    rate_hz: float | None
    period_s: float | None
    jitter_s: float | None
    gaps: int | None
    longest_gap_s: float | None
    size_bytes: int


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
    for number in entry.index_offsets or file.index.channels:
        places = file.message_places(entry, number)
        if places:
            share = entry.uncompressed_size // max(len(entry.index_offsets), 1)
            yield number, np.array([time for time, _ in places], np.int64), share


def _timing(times: NDArray[np.int64], size: int) -> Timing:
    times = np.sort(times)
    steps = np.diff(times)
    start, end = int(times[0]), int(times[-1])
    if len(steps) < 2 or not steps.any():
        rate = len(steps) * 1e9 / (end - start) if end > start else None
        return Timing(start, end, rate, None, None, None, None, size)
    period = float(np.median(steps[steps > 0]))
    gaps = steps > 1.5 * period
    usual = steps[~gaps]
    low, high = np.percentile(usual, (5, 95)) if len(usual) else (period, period)
    return Timing(
        start_ns=start,
        end_ns=end,
        rate_hz=len(steps) * 1e9 / (end - start),
        period_s=period * 1e-9,
        jitter_s=float(high - low) / 2e9,
        gaps=int(gaps.sum()),
        longest_gap_s=float(steps.max()) * 1e-9,
        size_bytes=size,
    )


def accounts(session: "Session") -> dict[str, Account]:
    """The recorder's last word on each topic; empty if the session has no accounts."""
    if session.schema(RECORDER.topic) != RECORDER.schema:
        return {}
    fields = ["topic", "offered", "written", "dropped", "refused", "lost"]
    columns = session.columns(RECORDER.topic, fields)
    rows = zip(*(columns[name].tolist() for name in fields), strict=True)
    return {topic: Account(*counts) for topic, *counts in rows}
