"""`seamlog info`: what is in a session, from its summary and message indexes."""

import time
from collections.abc import Mapping
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
    from seamlog.session_timing import Account, Timing

_FOLLOW_S = 1.0
_RIGHT = set(range(2, 12))


@command()
@session_argument
@click.option("--follow", is_flag=True, help="Stay until the recording ends, a line per second.")
def info(session: Path, follow: bool) -> Outcome:
    """Say what is in SESSION: channels, welds, attachments, and what is missing or damaged.

    Rates, gaps and jitter come from log times. Reads the summary and the message indexes, not the
    messages; an unfinished file is walked over. Exit code 1 if something is missing or damaged.
    """
    from seamlog.session import open_session
    from seamlog.session_timing import accounts, timing_of_topics

    with open_session(session) as opened:
        if follow:
            _follow(opened)
        timing, account = timing_of_topics(opened), accounts(opened)
        found = opened.info
        document = _document(opened, found, timing, account)
        text = _text(opened, found, timing, account)
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


def _document(
    session: "Session",
    found: "SessionInfo",
    timing: Mapping[str, "Timing"],
    account: Mapping[str, "Account"],
) -> dict[str, Any]:
    document = asdict(found) | {
        "paths": [str(path) for path in session.paths],
        "duration_s": found.duration_s,
        "attachments": [
            {"name": name, "media_type": row.media_type, "size_bytes": row.data_size}
            for name, row in _attachments(session)
        ],
    }
    document["channels"] = [
        asdict(channel) | _figures(channel, timing, account) for channel in found.channels.values()
    ]
    document["complete"] = _completeness(found, account)
    return document


def _figures(
    channel: "ChannelInfo", timing: Mapping[str, "Timing"], account: Mapping[str, "Account"]
) -> dict[str, Any]:
    found: dict[str, Any] = {"rate_hz": channel.rate_hz}
    if channel.topic in timing:
        known = asdict(timing[channel.topic])
        found |= {name: value for name, value in known.items() if name != "evenness"}
        found |= known["evenness"] or {}
    if channel.topic in account:
        found["account"] = asdict(account[channel.topic])
    return found


def _completeness(found: "SessionInfo", account: Mapping[str, "Account"]) -> bool | None:
    """Whether every message that was offered is there; None if nobody counted."""
    if found.problems:
        return False
    if not account:
        return None
    return not any(row.dropped or row.refused or row.lost for row in account.values())


def _attachments(session: "Session") -> list[tuple[str, Any]]:
    return [(name, session.attachments.entry(name)) for name in session.attachments]


def _text(
    session: "Session",
    found: "SessionInfo",
    timing: Mapping[str, "Timing"],
    account: Mapping[str, "Account"],
) -> str:
    return "\n\n".join(filter(None, (
        _head(session, found),
        _channels(found, timing, account),
        _verdict(found, account),
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


_HEAD = (
    "topic", "message", "count", "rate Hz", "from s", "to s",
    "jitter ms", "gaps", "longest s", "bytes",
)  # fmt: skip


def _channels(
    found: "SessionInfo", timing: Mapping[str, "Timing"], account: Mapping[str, "Account"]
) -> str:
    if not found.channels:
        return ""
    rows = [
        _channel(channel, found.start_ns, timing.get(channel.topic))
        for channel in found.channels.values()
    ]
    head: tuple[str, ...] = _HEAD
    if account:
        head = (*_HEAD, "dropped")
        rows = [(*row, _dropped(account.get(row[0]))) for row in rows]
    return _aligned([head, *rows])


def _channel(channel: "ChannelInfo", start_ns: int, timing: "Timing | None") -> tuple[str, ...]:
    name = channel.schema or channel.encoding
    if timing is None:
        return (channel.topic, name, str(channel.count), *[""] * (len(_HEAD) - 3))
    even = timing.evenness
    # a message now and then has no period that it could miss
    if even is None or even.gaps * 10 >= channel.count:
        steady = ("", "", "")
    else:
        steady = (f"{even.jitter_s * 1e3:.3g}", str(even.gaps), f"{even.longest_gap_s:.4g}")
    return (
        channel.topic,
        name,
        str(channel.count),
        "" if timing.rate_hz is None else f"{timing.rate_hz:.4g}",
        _seconds(timing.start_ns, start_ns),
        _seconds(timing.end_ns, start_ns),
        *steady,
        _size(timing.size_bytes),
    )


def _seconds(time_ns: int, start_ns: int) -> str:
    return f"{(time_ns - start_ns) / 1e9:.3f}"


def _dropped(account: "Account | None") -> str:
    return "" if account is None else str(account.dropped + account.refused + account.lost)


def _verdict(found: "SessionInfo", account: Mapping[str, "Account"]) -> str:
    if not account:
        return ""
    if _completeness(found, account):
        return "complete: every message that was offered is in the session"
    lost = sum(row.dropped + row.refused + row.lost for row in account.values())
    return (
        f"NOT complete: {lost} messages dropped, refused or lost; problems: {len(found.problems)}"
    )


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
