"""Examines the chunks of a file: CRC, records, times, indexes, and each channel's course."""

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import LimitExceeded
from seamlog.findings import Finding, Severity
from seamlog.mcap import records
from seamlog.mcap.channel_course import Courses
from seamlog.mcap.chunks import BARE, read_chunk
from seamlog.mcap.examine import RECOVER, Examination, times_of
from seamlog.mcap.heads import message_heads
from seamlog.mcap.message_index import index_count, read_message_index
from seamlog.mcap.records import ChunkEntry, Malformed
from seamlog.progress import track

_HEAD_TIMES = struct.Struct("<QQQI")


class ChunkExamination:
    """Goes through the chunks of one file; `courses` goes on from file to file of a session."""

    def __init__(self, frame: Examination, courses: Courses) -> None:
        self.frame, self.courses = frame, courses
        courses.begin_file()
        self._unproved = 0
        self._unindexed = 0

    def iter_findings(self) -> Iterator[Finding]:
        """What is wrong with the chunks, in file order; notes about all of them at the end."""
        entries = sorted(self.frame.found.chunks, key=lambda entry: entry.offset)
        for entry in track(entries, "checking chunks", len(entries)):
            yield from self._chunk(entry)
        yield from self._notes(len(entries))

    def _chunk(self, entry: ChunkEntry) -> Iterator[Finding]:
        frame = self.frame
        place = {"offset": entry.offset, "length": entry.length, **times_of(entry)}
        try:
            data = read_chunk(frame.source, entry, frame.limits)
            offsets, heads = message_heads(data)
        except (Malformed, LimitExceeded) as error:
            held = self._held(entry)
            cause = f"the chunk is damaged{held}: {error}"
            yield frame.finding("chunk-damaged", Severity.ERROR, cause, RECOVER, **place)
            return
        if entry.compression != BARE:
            yield from self._times(entry, heads)
            yield from self._message_indexes(entry, offsets, heads)
        else:
            self._unproved += 1
        for number in np.unique(heads["channel"]).tolist():
            mine = heads[heads["channel"] == number]
            channel = frame.found.channels.get(number)
            if channel is None:
                cause = f"{len(mine)} messages of channel {number}; what that is was lost"
                yield frame.finding("channel-unknown", Severity.ERROR, cause, RECOVER, **place)
            else:
                yield from self.courses.take(frame, channel, mine, entry)

    def _held(self, entry: ChunkEntry) -> str:
        counts = {n: index_count(self.frame.source, entry, n) for n in entry.index_offsets}
        known = [f"{count} of {self.frame.topic(n)}" for n, count in counts.items() if count]
        return f" ({', '.join(known)} by its message index)" if known else ""

    def _times(self, entry: ChunkEntry, heads: NDArray[Any]) -> Iterator[Finding]:
        start, end, _, crc = _HEAD_TIMES.unpack_from(
            self.frame.source.data, entry.offset + records.RECORD_HEAD.size
        )
        self._unproved += not crc
        if not len(heads):
            return
        first, last = int(heads["log_time"].min()), int(heads["log_time"].max())
        if (start, end) != (first, last):
            yield self.frame.finding(
                "chunk-times",
                Severity.ERROR,
                "the chunk names other times than those of its messages",
                RECOVER,
                offset=entry.offset,
                length=entry.length,
                start_ns=first,
                end_ns=last,
            )

    def _message_indexes(
        self, entry: ChunkEntry, offsets: NDArray[np.int64], heads: NDArray[Any]
    ) -> Iterator[Finding]:
        if not entry.index_length:
            self._unindexed += 1
            return
        for number in np.unique(heads["channel"]).tolist():
            mine = heads["channel"] == number
            rows = read_message_index(self.frame.source, entry, number)
            if rows is None or not _agrees(rows, offsets[mine], heads["log_time"][mine]):
                yield self.frame.finding(
                    "message-index",
                    Severity.ERROR,
                    "the message index behind the chunk is not that of its messages; seamlog "
                    "reads on without it, other readers may miss messages",
                    RECOVER,
                    offset=entry.index_offsets.get(number) or entry.offset,
                    topic=self.frame.topic(number),
                    **times_of(entry),
                )

    def _notes(self, count: int) -> Iterator[Finding]:
        if self._unproved:
            cause = f"{self._unproved} of {count} chunks carry no CRC: damage cannot be told there"
            action = "nothing: it is legal; seamlog itself always writes one"
            yield self.frame.finding("chunk-without-crc", Severity.NOTE, cause, action)
        if self._unindexed:
            cause = f"{self._unindexed} of {count} chunks have no message index behind them"
            action = "nothing for seamlog; JavaScript readers refuse such files"
            yield self.frame.finding("no-message-index", Severity.NOTE, cause, action)


def _agrees(rows: memoryview, offsets: NDArray[np.int64], log_times_ns: NDArray[np.uint64]) -> bool:
    told = np.frombuffer(rows, "<u8").reshape(-1, 2)
    told = told[np.argsort(told[:, 1], kind="stable")]
    if len(told) != len(offsets):
        return False
    same = told[:, 1] == offsets.astype(np.uint64)
    return bool(same.all() and (told[:, 0] == log_times_ns).all())
