"""What a recording came to, in words and as a document."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from seamlog.channels import CHANNELS
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from seamlog.recorder.accounts import Account
    from seamlog.recorder.session_run import Run


def record_outcome(run: "Run", output: Path) -> Outcome:
    """The end of a recording: counts per topic, what went wrong, what an answer survives."""
    ending = Ending.PASS if run.status.is_complete else Ending.FINDING
    return Outcome("seamlog.record", _text(run, output), _document(run), ending)


def _document(run: "Run") -> dict[str, Any]:
    from seamlog.recorder.accounts import account_document, acknowledgement

    return {
        "path": run.status.path,
        "recording_id": run.status.recording_id,
        "ended": run.ending,
        "complete": run.status.is_complete,
        "findings": list(run.status.findings),
        "channels": [account_document(row) for row in run.status.channels],
        "segments": list(run.status.files),
        "files": [str(path) for path in run.files],
        "acknowledgement": acknowledgement(run.status.sync),
    }


def _text(run: "Run", output: Path) -> str:
    from seamlog.recorder.accounts import acknowledgement

    written = sum(row.written for row in run.status.channels)
    lines = [f"{output}: {written} messages; {run.ending}"]
    if more := run.status.files[1:]:
        lines += [f"it goes on in {len(more)} more file{'s'[: len(more) > 1]}, up to {more[-1]}"]
    lines += [f"{path}: written by the source" for path in run.files]
    wide = max((len(row.topic) for row in run.status.channels), default=5)
    lines += [f"  {'topic':<{wide}}  {'written':>9} {'dropped':>8} {'refused':>8}  longest gap"]
    lines += [f"  {row.topic:<{wide}}  {_counts(row)}" for row in run.status.channels]
    lines += [f"  {finding}" for finding in run.status.findings]
    lines += [_verdict(run), "What an acknowledgement survives:"]
    levels = acknowledgement(run.status.sync).items()
    return "\n".join(lines + [f"  {level}: {text}" for level, text in levels])


def _counts(row: "Account") -> str:
    steady = CHANNELS[row.topic].rate_hz is not None
    gap = f"{row.longest_gap_s:.3f} s" if steady and row.longest_gap_s is not None else "-"
    counts = f"{row.written:>9} {row.dropped:>8} {row.refused:>8}  {gap}"
    return f"{counts}  ({row.reason})" if row.reason else counts


def _verdict(run: "Run") -> str:
    rows = run.status.channels
    if run.status.is_complete and (discarded := sum(row.discarded for row in rows)):
        return f"Complete: all around the triggers; {discarded} other messages were discarded."
    if run.status.is_complete:
        return "Complete: every message that the source offered is in the session."
    counts = {
        name: sum(getattr(row, name) for row in rows)
        for name in ("dropped", "refused", "lost", "waiting")
    }
    told = "{dropped} dropped, {refused} refused, {lost} lost".format_map(counts)
    if counts["waiting"]:
        told += f", {counts['waiting']} accepted and still in memory: 'seamlog recover' saves them"
    return f"INCOMPLETE: {told}."
