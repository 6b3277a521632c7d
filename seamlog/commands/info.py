"""`seamlog info`: what is in a session, from its summary alone."""

import time
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, session_argument
from seamlog.outcome import Ending, Outcome
from seamlog.progress import tell

if TYPE_CHECKING:
    from seamlog.session import ChannelInfo, Session, SessionInfo

_FOLLOW_S = 1.0
_RIGHT = {2, 3, 4, 5}


@command()
@session_argument
@click.option("--follow", is_flag=True, help="Stay until the recording ends, a line per second.")
def info(session: Path, follow: bool) -> Outcome:
    """Say what is in SESSION: channels, welds, attachments, and what is missing or damaged.

    Reads the summary, not the messages; an unfinished file is walked over. Exit code 1 if
    something is missing or damaged.
    """
    from seamlog.session import open_session

    with open_session(session) as opened:
        if follow:
            _follow(opened)
        found = opened.info
        document = _document(opened, found)
        text = _text(opened, found)
    ending = Ending.FINDING if found.problems else Ending.PASS
    return Outcome("seamlog.info", text, document, ending)


def _follow(session: "Session") -> None:
    """Say each second what has come, until nobody records any more."""
    before = 0
    while True:
        going_on = session.is_being_recorded
        if session.grow() or not before:
            before = _tell_growth(session, before)
        if not going_on:
            return
        time.sleep(_FOLLOW_S)


def _tell_growth(session: "Session", before: int) -> int:
    found = session.info
    size = f"{_size(found.size_bytes)} in {len(session.paths)} file(s)"
    more = found.message_count - before
    tell(f"{found.duration_s:9.1f} s  {found.message_count:>10} messages (+{more})  {size}")
    return found.message_count


def _document(session: "Session", found: "SessionInfo") -> dict[str, Any]:
    document = asdict(found) | {
        "paths": [str(path) for path in session.paths],
        "duration_s": found.duration_s,
        "attachments": [
            {"name": name, "media_type": row.media_type, "size_bytes": row.data_size}
            for name, row in _attachments(session)
        ],
    }
    document["channels"] = [
        asdict(channel) | {"rate_hz": channel.rate_hz} for channel in found.channels.values()
    ]
    return document


def _attachments(session: "Session") -> list[tuple[str, Any]]:
    return [(name, session.attachments.entry(name)) for name in session.attachments]


def _text(session: "Session", found: "SessionInfo") -> str:
    return "\n\n".join(filter(None, (
        _head(session, found),
        _channels(found),
        _welds(found),
        _listed("attachments", [
            f"{name}  {row.media_type}  {_size(row.data_size)}"
            for name, row in _attachments(session)
        ]),
        _listed("metadata", list(dict.fromkeys(found.metadata))),
        _listed("problems", found.problems),
    )))  # fmt: skip


def _head(session: "Session", found: "SessionInfo") -> str:
    files = len(session.paths)
    plural = "" if files == 1 else f" in {files} files"
    lines = [f"{session.path}  {_size(found.size_bytes)}{plural}  {found.library}".rstrip()]
    if found.message_count:
        lines.append(
            f"{found.message_count} messages from {_date(found.start_ns)}, {found.duration_s:.3f} s"
        )
    else:
        lines.append("no messages")
    return "\n".join(lines)


def _channels(found: "SessionInfo") -> str:
    if not found.channels:
        return ""
    head = ("topic", "message", "count", "rate Hz", "from s", "to s")
    rows = [_channel(channel, found.start_ns) for channel in found.channels.values()]
    return _aligned([head, *rows])


def _channel(channel: "ChannelInfo", start_ns: int) -> tuple[str, ...]:
    rate = "" if channel.rate_hz is None else f"{channel.rate_hz:.4g}"
    span = ["" if t is None else f"{(t - start_ns) / 1e9:.3f}" for t in _span(channel)]
    return (channel.topic, channel.schema or channel.encoding, str(channel.count), rate, *span)


def _span(channel: "ChannelInfo") -> tuple[int | None, int | None]:
    return channel.start_ns, channel.end_ns


def _welds(found: "SessionInfo") -> str:
    if not found.welds:
        return ""
    rows = [
        (
            str(weld.number),
            "",
            f"{weld.duration_s:.3f}",
            f"{(weld.start_ns - found.start_ns) / 1e9:.3f}",
            f"{(weld.end_ns - found.start_ns) / 1e9:.3f}",
        )
        for weld in found.welds
    ]
    return _aligned([("weld", "", "length s", "from s", "to s"), *rows])


def _aligned(rows: list[tuple[str, ...]]) -> str:
    widths = [max(len(row[place]) for row in rows) for place in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = (
            cell.rjust(width) if place in _RIGHT else cell.ljust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def _listed(title: str, items: list[str]) -> str:
    return "\n".join([title, *(f"  {item}" for item in items)]) if items else ""


def _date(time_ns: int) -> str:
    return datetime.fromtimestamp(time_ns / 1e9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _size(count: int) -> str:
    size = float(count)
    for unit in ("B", "kB", "MB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} GB"
