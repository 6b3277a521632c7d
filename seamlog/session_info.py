"""What a session holds, in figures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from seamlog.mcap.file import ENDLESS, McapFile
from seamlog.mcap.records import ChannelRecord
from seamlog.segments import RECORDING
from seamlog.welds import Weld

if TYPE_CHECKING:
    from seamlog.session import Session


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A topic; times are those of its first and last message, None where the file cannot tell."""

    topic: str
    schema: str
    encoding: str
    count: int
    metadata: Mapping[str, str] = field(default_factory=dict)
    start_ns: int | None = None
    end_ns: int | None = None

    @property
    def rate_hz(self) -> float | None:
        """Mean rate between first and last message; None if unknown."""
        if self.start_ns is None or self.end_ns is None or self.end_ns <= self.start_ns:
            return None
        return (self.count - 1) * 1e9 / (self.end_ns - self.start_ns)


@dataclass(frozen=True, slots=True)
class SessionInfo:
    """Log times of the first and the last message (0 if there is none), and what there is."""

    start_ns: int
    end_ns: int
    message_count: int
    channels: dict[str, ChannelInfo]
    welds: list[Weld]
    attachments: list[str]
    metadata: list[str]
    size_bytes: int
    recording_id: str | None
    library: str
    problems: list[str]

    @property
    def duration_s(self) -> float:
        """From the first to the last message, in seconds."""
        return (self.end_ns - self.start_ns) / 1e9


def session_info(session: "Session") -> SessionInfo:
    """Collect the figures of `session`; a window reads the log times inside it."""
    rows = [(file, row) for file in session.files for row in file.index.channels.values()]
    channels: dict[str, ChannelInfo] = {}
    for file, row in rows:
        here = _channel(session, file, row)
        known = channels.get(row.topic)
        channels[row.topic] = here if known is None else _merged(known, here)
    spans = _spans(session, channels)
    welds = session.welds
    return SessionInfo(
        start_ns=min((start for start, _ in spans), default=0),
        end_ns=max((end for _, end in spans), default=0),
        message_count=sum(channel.count for channel in channels.values()),
        channels=dict(sorted(channels.items())),
        welds=welds,
        attachments=list(session.attachments),
        metadata=list(session.metadata),
        size_bytes=sum(file.source.size for file in session.files),
        recording_id=session.metadata.get(RECORDING, {}).get("id"),
        library=session.files[0].index.library,
        problems=session.problems,
    )


def _spans(session: "Session", channels: dict[str, ChannelInfo]) -> list[tuple[int, int]]:
    if session.span != ENDLESS:
        found = [(c.start_ns, c.end_ns) for c in channels.values()]
        return [(a, b) for a, b in found if a is not None and b is not None]
    counted = [file.index.statistics for file in session.files]
    return [(row.start_ns, row.end_ns) for row in counted if row.message_count]


def _channel(session: "Session", file: McapFile, row: ChannelRecord) -> ChannelInfo:
    schema = file.index.schemas.get(row.schema_id)
    name = schema.name if schema else ""
    if session.span != ENDLESS:
        times = file.log_times_ns(row, session.span)
        count = len(times)
        start, end = (int(times.min()), int(times.max())) if count else (None, None)
    else:
        count = file.index.statistics.channel_counts.get(row.id, 0)
        start, end = _known_span(file, row.id)
    return ChannelInfo(row.topic, name, row.message_encoding, count, row.metadata, start, end)


def _known_span(file: McapFile, channel_id: int) -> tuple[int | None, int | None]:
    entries = file.entries(channel_id)
    if not entries or any(set(entry.index_offsets) != {channel_id} for entry in entries):
        return None, None
    return min(e.start_ns for e in entries), max(e.end_ns for e in entries)


def _merged(one: ChannelInfo, other: ChannelInfo) -> ChannelInfo:
    starts = [c.start_ns for c in (one, other) if c.count]
    ends = [c.end_ns for c in (one, other) if c.count]
    known = bool(starts) and None not in starts and None not in ends
    return ChannelInfo(
        one.topic,
        one.schema,
        one.encoding,
        one.count + other.count,
        {**other.metadata, **one.metadata},
        min(t for t in starts if t is not None) if known else None,
        max(t for t in ends if t is not None) if known else None,
    )
