"""`seamlog doctor`: is a session whole, and if not, what is wrong where. Changes nothing."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from seamlog.command import command, session_argument
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from seamlog.findings import Finding
    from seamlog.session import Session


@command()
@session_argument
def doctor(session: Path) -> Outcome:
    """Examine SESSION, finished or not: every CRC, indexes, statistics, sequences, accounts.

    Reads only. Exit code 1 if something is missing, damaged or was disturbed.
    """
    from seamlog.findings import Severity, few
    from seamlog.session import open_session

    with open_session(session) as opened:
        findings = list(few(examine(opened)))
        checked = {
            "paths": [str(path) for path in opened.paths],
            "size_bytes": sum(file.source.size for file in opened.files),
            "messages": sum(f.index.statistics.message_count for f in opened.files),
        }
    is_well = all(finding.severity is Severity.NOTE for finding in findings)
    document = checked | {
        "is_whole": not any(finding.severity is Severity.ERROR for finding in findings),
        "findings": [finding.document() for finding in findings],
    }
    text = _text(session, findings, is_well)
    return Outcome("seamlog.doctor", text, document, Ending.PASS if is_well else Ending.FINDING)


def examine(session: "Session") -> "Iterator[Finding]":
    """All that is wrong with an open session, file by file, then across them."""
    from seamlog.accounts_check import iter_account_findings, without_discarded
    from seamlog.mcap.channel_course import Courses
    from seamlog.mcap.examine import Examination
    from seamlog.mcap.examine_chunks import ChunkExamination

    courses = Courses()
    for file in session.files:
        frame = Examination(file.source, file.index, session.limits)
        yield from frame.iter_findings()
        yield from without_discarded(session, ChunkExamination(frame, courses).iter_findings())
    yield from iter_account_findings(session, courses)


def _text(session: Path, findings: "list[Finding]", is_well: bool) -> str:
    lines = [line for finding in findings for line in _lines(finding)]
    count = len(findings)
    verdict = "whole: every CRC, index and count is right"
    if not is_well:
        verdict = f"{count} finding{'s' if count > 1 else ''}"
    return "\n".join([f"{session}: {verdict}", *lines])


def _lines(finding: "Finding") -> list[str]:
    time = "" if finding.start_ns is None else f", {_clock(finding.start_ns)}"
    place = f"{finding.place()}{time}".removeprefix(", ")
    head = f"  {finding.severity.value:<7}  {finding.id:<18}  {finding.path.name}"
    return [
        f"{head}{f'  {place}' if place else ''}",
        f"           {finding.cause}",
        f"           do: {finding.action}",
    ]


def _clock(time_ns: int) -> str:
    if time_ns > 4_000_000_000_000_000_000:
        return f"{time_ns} ns"
    moment = datetime.fromtimestamp(time_ns // 1_000_000_000, UTC)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{time_ns // 1_000_000 % 1000:03d} UTC"
