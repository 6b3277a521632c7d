"""The recorder's own accounts and events in a session, against what is in its files."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from seamlog.channels import CHANNELS, EVENT_KINDS
from seamlog.errors import SeamlogError
from seamlog.files import is_being_written
from seamlog.findings import Finding, Severity
from seamlog.mcap.channel_course import Courses
from seamlog.segments import PROBLEMS, RECORDING
from seamlog.session import Session

_STATUS, _EVENTS = CHANNELS["/seamlog/recorder"], CHANNELS["/events"]
_OWN = (_STATUS.topic, _EVENTS.topic)
_SHORTFALLS = ("dropped", "refused", "lost")
END = "seamlog.recording.end"
_KINDS = {number: name for name, number in EVENT_KINDS.items()}


def iter_account_findings(session: Session, courses: Courses) -> Iterator[Finding]:
    """Drops, losses, sums that do not add up, clock steps, and how the recording ended."""
    yield from _files(session)
    yield from _ending(session)
    yield from _copied(session)
    yield from _clock_steps(session)
    for row in _last_accounts(session):
        yield from _account(session, row, courses)


def without_discarded(session: Session, findings: Iterable[Finding]) -> Iterator[Finding]:
    """`findings`, where gaps between snapshots are no errors."""
    discarded = {row["topic"] for row in _last_accounts(session) if row["discarded"]}
    for finding in findings:
        if finding.id == "sequence-gap" and finding.topic in discarded:
            cause = f"{finding.cause} or, most likely, are part of no snapshot"
            yield replace(finding, severity=Severity.NOTE, cause=cause)
        else:
            yield finding


def _files(session: Session) -> Iterator[Finding]:
    """Files that the recording had and that are not here."""
    recordings = [
        values for file in session.files for name, values in file.metadata if name == RECORDING
    ]
    present = {int(row["index"]) for row in recordings if row.get("index", "").isdigit()}
    missing = sorted(set(range(1, max(present, default=0) + 1)) - present)
    if not missing:
        return
    named = ", ".join(map(str, missing))
    if len(missing) <= _removed(session):
        cause = f"file {named} of the recording was removed to keep its disk budget"
        yield _finding(session, "file-removed", Severity.NOTE, cause, "nothing: as configured")
    else:
        cause = f"file {named} of the recording is not here"
        yield _finding(session, "file-missing", Severity.ERROR, cause, "put it beside the others")


def _removed(session: Session) -> int:
    return int(session.metadata.get(RECORDING, {}).get("removed", "0"))


def _ending(session: Session) -> Iterator[Finding]:
    recording = session.metadata.get(RECORDING, {})
    end = session.metadata.get(END)
    if end and end.get("ending") != "closed":
        cause = f"the recording was not closed: {end.get('ending')}"
        yield _finding(session, "ended", Severity.WARNING, cause, "look at what ended the loop")
    rings = recording.get("ring_path", "")
    is_living = any(is_being_written(path) for path in session.paths)
    if not end and rings and Path(rings).is_dir() and not is_living:
        cause = f"accepted messages that are not in the file yet are in {rings}"
        action = "'seamlog recover' takes them"
        yield _finding(session, "rings-left", Severity.ERROR, cause, action)


def _copied(session: Session) -> Iterator[Finding]:
    for text in session.metadata.get(PROBLEMS, {}).values():
        cause = f"the session copied here was not whole: {text}"
        yield _finding(session, "copied-problem", Severity.WARNING, cause, "see the original")


def _clock_steps(session: Session) -> Iterator[Finding]:
    events = _columns(session, _EVENTS.topic)
    for time, kind, detail in zip(*events.values(), strict=True) if events else ():
        if _KINDS.get(int(kind)) == "CLOCK_STEP":
            action = "nothing for log time; stamps from the wall clock moved with it"
            place = {"topic": _EVENTS.topic, "start_ns": int(time), "end_ns": int(time)}
            yield _finding(
                session, "wall-clock-step", Severity.WARNING, str(detail), action, **place
            )


def _columns(session: Session, topic: str) -> dict[str, Any]:
    if session.schema(topic) != CHANNELS[topic].schema:
        return {}
    names = ["kind", "detail"] if topic == _EVENTS.topic else None
    try:
        columns = session.columns(topic, names)
    except SeamlogError:
        return {}
    kept = ("log_time_ns", *names) if names else tuple(columns)
    return {name: columns[name] for name in kept}


def _last_accounts(session: Session) -> list[dict[str, Any]]:
    """The last status of each topic; of topics with several producers the sum."""
    columns = _columns(session, _STATUS.topic)
    if not columns:
        return []
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    newest: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in rows:
        same = newest[str(row["topic"])]
        if same and same[-1]["log_time_ns"] != row["log_time_ns"]:
            same.clear()
        same.append(row)
    names = ("offered", "accepted", *_SHORTFALLS, "written", "discarded")
    return [
        {"topic": topic, "log_time_ns": int(same[0]["log_time_ns"])}
        | {name: sum(int(row.get(name, 0)) for row in same) for name in names}
        for topic, same in newest.items()
    ]


def _account(session: Session, row: Mapping[str, Any], courses: Courses) -> Iterator[Finding]:
    topic, time = row["topic"], row["log_time_ns"]
    place = {"topic": topic, "start_ns": time, "end_ns": time}
    if row["offered"] != row["accepted"] + row["dropped"] + row["refused"]:
        cause = "the accounts do not add up: offered is not accepted + dropped + refused"
        action = "report it: this is a bug of the recorder"
        yield _finding(session, "accounts", Severity.ERROR, cause, action, **place)
    for name in _SHORTFALLS:
        if row[name]:
            cause = f"{row[name]} of {row['offered']} messages were {name} while recording"
            action = "see /events for the reason"
            yield _finding(session, name, Severity.ERROR, cause, action, **place)
    there = sum(course.count for key, course in courses.by_channel.items() if key[0] == topic)
    is_final = END in session.metadata and topic not in _OWN and not _removed(session)
    if is_final and row["written"] != there:
        cause = f"the recorder wrote {row['written']} messages and {there} are readable"
        action = "'seamlog recover' says what is missing where"
        yield _finding(session, "messages-missing", Severity.ERROR, cause, action, **place)


def _finding(
    session: Session, name: str, severity: Severity, cause: str, action: str, **place: Any
) -> Finding:
    return Finding(name, severity, session.path, cause, action, **place)
