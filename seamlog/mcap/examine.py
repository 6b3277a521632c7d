"""Examines the build of one MCAP file: every CRC, and everything that is told twice compared."""

import struct
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from zlib_ng.zlib_ng import crc32

from seamlog.errors import LimitExceeded, SessionError
from seamlog.files import is_being_written
from seamlog.findings import Finding, Severity
from seamlog.limits import Limits
from seamlog.mcap import records
from seamlog.mcap.attachments import read_attachment
from seamlog.mcap.index import FileIndex
from seamlog.mcap.records import ChunkEntry
from seamlog.mcap.salvage import proved_summary
from seamlog.mcap.scan import scan
from seamlog.mcap.source import FileSource

RECOVER = "'seamlog recover' makes a session of all that is whole"
_DATA_END_BYTES = records.RECORD_HEAD.size + 4


class Examination:
    """One file: what its summary tells, what a walk finds, and how the two differ.

    `told` is what opening the file gave. Raises `SessionError` or `LimitExceeded` as that does.
    """

    def __init__(self, source: FileSource, told: FileIndex, limits: Limits) -> None:
        self.source, self.told, self.limits = source, told, limits
        self.found = scan(source, "", limits) if self.told.summary_start else self.told
        self.is_living = is_being_written(source.path)

    def iter_findings(self) -> Iterator[Finding]:
        """What is wrong with the file's frame; its chunks are examined one by one elsewhere."""
        yield from self._end()
        yield from self._gaps()
        yield from self._attachments()
        start = self.told.summary_start or proved_summary(self.source)
        if start is not None:
            yield from self._data_crc(start)
        if self.told.summary_start is not None:
            yield from self._rows(self.told, self.found)
            yield from self._statistics()

    def finding(
        self, name: str, severity: Severity, cause: str, action: str, **place: Any
    ) -> Finding:
        """A finding about this file."""
        return replace(Finding(name, severity, self.source.path, cause, action), **place)

    def _end(self) -> Iterator[Finding]:
        start, error = self.told.summary_start, Severity.ERROR
        if start is None and self.told.problems:
            is_open = self.source.data[-len(records.MAGIC) :] != records.MAGIC
            name = "unfinished" if is_open else "summary-damaged"
            if self.is_living:
                cause = "the session is being recorded and was examined as far as it goes"
                yield self.finding("recording", Severity.NOTE, cause, "nothing: let it go on")
            else:
                yield self.finding(name, error, self.told.problems[0], RECOVER)
        elif start is None:
            cause = "the file has no summary with a chunk index; it is read by walking over it"
            yield self.finding("no-summary", Severity.NOTE, cause, "nothing: it is legal")
        elif not struct.unpack_from("<I", self.source.data, self.source.size - 12)[0]:
            cause = "the summary carries no CRC, so damage to it cannot be told"
            action = "nothing: other writers leave it out"
            yield self.finding("summary-without-crc", Severity.NOTE, cause, action, offset=start)
        if self.source.data[: len(records.MAGIC)] != records.MAGIC or not self.found.library:
            cause = "the first bytes, magic and header, are damaged or empty"
            severity = error if self.source.data[:8] != records.MAGIC else Severity.NOTE
            yield self.finding("header", severity, cause, RECOVER, offset=0, length=8)

    def _gaps(self) -> Iterator[Finding]:
        for start, end in self.found.gaps:
            if self.is_living and end == self.source.size:
                continue
            cause = "these bytes are no whole record: overwritten, cut off or never written"
            yield self.finding(
                "bytes-lost", Severity.ERROR, cause, RECOVER, offset=start, length=end - start
            )
        for offset, length, fault in self.found.left_out:
            cause = f"the record is damaged: {fault}"
            yield self.finding(
                "record-damaged", Severity.ERROR, cause, RECOVER, offset=offset, length=length
            )

    def _attachments(self) -> Iterator[Finding]:
        for entry in self.found.attachments:
            try:
                read_attachment(self.source, entry, self.limits)
            except (SessionError, LimitExceeded) as error:
                yield self.finding(
                    "attachment-crc",
                    Severity.ERROR,
                    str(error),
                    "put the file in again with 'seamlog attach --force'",
                    offset=entry.offset,
                    length=entry.length,
                )

    def _data_crc(self, summary_start: int) -> Iterator[Finding]:
        at = summary_start - _DATA_END_BYTES
        if at < 0 or records.RECORD_HEAD.unpack_from(self.source.data, at) != (
            records.DATA_END,
            4,
        ):
            cause = "no end-of-data record stands in front of the summary"
            yield self.finding("data-end", Severity.WARNING, cause, RECOVER, offset=max(at, 0))
            return
        (stored,) = struct.unpack_from("<I", self.source.data, summary_start - 4)
        if stored and crc32(self.source.data[:at]) != stored:
            cause = "the CRC over all data is wrong: something in front of the summary has changed"
            yield self.finding("data-crc", Severity.ERROR, cause, RECOVER, offset=0, length=at)

    def _rows(self, told: FileIndex, found: FileIndex) -> Iterator[Finding]:
        pairs = (
            ("chunk", told.chunks, found.chunks),
            ("attachment", told.attachments, found.attachments),
            ("metadata", told.metadata, found.metadata),
        )
        for kind, listed, there in pairs:
            if not listed:
                continue
            index = {row.offset: row for row in listed}
            data = {row.offset: row for row in there}
            for offset in sorted(index.keys() | data.keys()):
                cause = _difference(kind, index.get(offset), data.get(offset))
                if cause:
                    length = (index.get(offset) or data[offset]).length
                    yield self.finding(
                        f"{kind}-index",
                        Severity.ERROR,
                        cause,
                        RECOVER,
                        offset=offset,
                        length=length,
                    )

    def _statistics(self) -> Iterator[Finding]:
        told, found = self.told.statistics, self.found.statistics
        if not told.message_count and not told.chunk_count:
            return
        faults = []
        if told.message_count != found.message_count:
            faults.append(f"{told.message_count} messages where {found.message_count} are there")
        for number in sorted(told.channel_counts.keys() | found.channel_counts.keys()):
            one, other = told.channel_counts.get(number, 0), found.channel_counts.get(number, 0)
            if one != other and told.channel_counts:
                faults.append(f"{one} of {self.topic(number)} where {other} are there")
        if found.message_count and (told.start_ns, told.end_ns) != (found.start_ns, found.end_ns):
            faults.append("other times of the first or last message")
        for fault in faults:
            cause = f"the statistics count {fault}"
            yield self.finding("statistics", Severity.ERROR, cause, RECOVER)

    def topic(self, channel_id: int) -> str:
        """The topic of a channel."""
        row = self.found.channels.get(channel_id) or self.told.channels.get(channel_id)
        return row.topic if row else f"channel {channel_id}"


def _difference(kind: str, told: object, found: object) -> str:
    """How a row of an index and what stands in the file differ; empty if they do not."""
    if told is None:
        return f"this {kind} is in no index: readers that trust the summary miss it"
    if found is None:
        return f"the index lists a {kind} here, and none is here"
    if isinstance(told, ChunkEntry) and isinstance(found, ChunkEntry):
        if not told.index_offsets:
            found = found._replace(index_offsets={}, index_length=told.index_length)
        names = [
            name
            for name, one, other in zip(told._fields, told, found, strict=True)
            if one != other and not (name == "index_offsets" and dict(told[4]) == dict(found[4]))
        ]
        return f"the index says otherwise of this chunk: {', '.join(names)}" if names else ""
    return "" if told == found else f"the index says otherwise of this {kind}"


def times_of(entry: ChunkEntry) -> dict[str, int]:
    """Times of a chunk, for a finding."""
    return {"start_ns": entry.start_ns, "end_ns": entry.end_ns}
