"""Whether the recording is whole: drops, losses, gaps, clock steps, damage."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import CHANNELS, CLOCK_STEP, EMERGENCY_STOP, EVENT_KINDS, FAULT
from seamlog.results import Figure, Finding, Part, Place, Severity, input_of

from .part_tables import Tables

if TYPE_CHECKING:
    from seamlog.session import Session

RECORDER, EVENTS = "/seamlog/recorder", "/events"
GAP_PERIODS = 3.0
"""A pause longer than this many periods is a gap."""
STEP_S = 0.05
"""A lasting change between stamps and log times larger than this is a step of a clock."""
_FEWEST = 20
_AROUND = 10
_TOLD = 3
_COUNTS = ("offered", "accepted", "dropped", "refused", "written", "lost")


@dataclass(frozen=True)
class _Rhythm:
    """Times of one channel: period, longest pause, gaps as (log time, length)."""

    topic: str
    count: int
    period_s: float
    longest_s: float
    gaps: list[tuple[int, float]]


def health_part(session: "Session") -> tuple[Part, Tables]:
    """Part `health` of a whole session, with table `channels`."""
    rhythms = [_rhythm(session, topic) for topic in session.info.channels if topic != RECORDER]
    accounts = _accounts(session)
    findings = [
        *_event_findings(session),
        *(finding for rhythm in rhythms for finding in _gap_findings(rhythm)),
        *_clock_findings(session),
        *_account_findings(accounts),
    ]
    problems = [Finding(severity=Severity.FAULT, message=text) for text in session.problems]
    info = session.info
    part = Part(
        part="health",
        title="Recording health",
        reason="no limits were given",
        inputs=[input_of(path) for path in session.paths],
        figures=_figures(info.message_count, info.duration_s, rhythms, accounts),
        findings=[*problems, *findings],
        details={
            "end_ns": max((w.end_ns for w in session.welds), default=info.end_ns),
            "metadata": {
                **session.metadata.get("seamlog.weld", {}),
                **session.metadata.get("seamlog.recording", {}),
            },
        },
    )
    return part, {"channels": _table(rhythms, accounts)}


def _rhythm(session: "Session", topic: str) -> _Rhythm:
    times = session.columns(topic, [])["log_time_ns"]
    steps = np.diff(times)
    known = CHANNELS.get(topic)
    if len(times) < _FEWEST or (known is not None and known.rate_hz is None):
        return _Rhythm(topic, len(times), float("nan"), float("nan"), [])
    period = float(np.median(steps))
    long = np.flatnonzero(steps > GAP_PERIODS * period)
    gaps = [(int(times[row]), float(steps[row]) * 1e-9) for row in long]
    return _Rhythm(topic, len(times), period * 1e-9, float(steps.max()) * 1e-9, gaps)


def _gap_findings(rhythm: _Rhythm) -> Iterator[Finding]:
    longest = sorted(rhythm.gaps, key=lambda gap: -gap[1])[:_TOLD]
    for time_ns, length_s in longest:
        text = f"{rhythm.topic}: no message for {length_s:.3f} s (usual: {rhythm.period_s:.3f} s)"
        more = len(rhythm.gaps) - len(longest)
        if more and (time_ns, length_s) == longest[-1]:
            text += f"; {more} shorter gaps more"
        place = Place(time_ns=time_ns)
        yield Finding(severity=Severity.WARNING, message=text, place=place)


def _accounts(session: "Session") -> dict[str, dict[str, int]] | None:
    """Last account of each topic, summed over its producers; None where nobody kept accounts."""
    if RECORDER not in session.info.channels or not session.info.channels[RECORDER].count:
        return None
    columns = session.columns(RECORDER)
    newest = int(columns["log_time_ns"].max())
    last = columns["log_time_ns"] == newest
    found: dict[str, dict[str, int]] = {}
    for row in np.flatnonzero(last):
        counts = found.setdefault(str(columns["topic"][row]), dict.fromkeys(_COUNTS, 0))
        for name in _COUNTS:
            counts[name] += int(columns[name][row])
    return found


def _account_findings(accounts: dict[str, dict[str, int]] | None) -> Iterator[Finding]:
    for topic, counts in (accounts or {}).items():
        missing = {name: counts[name] for name in ("dropped", "refused", "lost") if counts[name]}
        if missing:
            told = ", ".join(f"{count} {name}" for name, count in missing.items())
            text = f"{topic}: {told} of {counts['offered']} messages offered"
            yield Finding(severity=Severity.FAULT, message=text)


def _event_findings(session: "Session") -> Iterator[Finding]:
    if EVENTS not in session.info.channels:
        return
    names = {value: name for name, value in EVENT_KINDS.items()}
    columns = session.columns(EVENTS)
    for kind, detail, time_ns in zip(
        columns["kind"].tolist(), columns["detail"], columns["log_time_ns"].tolist(), strict=True
    ):
        if kind in (FAULT, EMERGENCY_STOP, CLOCK_STEP):
            severity = Severity.WARNING if kind == CLOCK_STEP else Severity.FAULT
            yield Finding(
                severity=severity,
                message=f"{names[kind]}: {detail}".rstrip(": "),
                place=Place(time_ns=time_ns),
            )


def _clock_findings(session: "Session") -> Iterator[Finding]:
    for topic in session.info.channels:
        if topic in (RECORDER, EVENTS) or topic not in CHANNELS:
            continue
        if "stamp_ns" not in CHANNELS[topic].field_names:
            continue
        columns = session.columns(topic, ["stamp_ns"])
        for time_ns, step_s in clock_steps(columns["stamp_ns"], columns["log_time_ns"]):
            text = f"{topic}: its stamps step by {step_s:+.3f} s against log time"
            yield Finding(severity=Severity.WARNING, message=text, place=Place(time_ns=time_ns))


def clock_steps(
    stamp_ns: NDArray[np.int64], log_time_ns: NDArray[np.int64]
) -> list[tuple[int, float]]:
    """Lasting jumps of stamp - log time larger than STEP_S: (log time, jump in s)."""
    ahead_s = (stamp_ns - log_time_ns) * 1e-9
    steps: list[tuple[int, float]] = []
    for row in np.flatnonzero(np.abs(np.diff(ahead_s)) > STEP_S):
        before = ahead_s[max(0, row + 1 - _AROUND) : row + 1]
        after = ahead_s[row + 1 : row + 1 + _AROUND]
        jump = float(np.median(after) - np.median(before))
        if abs(jump) > STEP_S and len(after) >= _AROUND // 2:
            steps.append((int(log_time_ns[row + 1]), jump))
    return steps


def _figures(
    messages: int,
    duration_s: float,
    rhythms: list[_Rhythm],
    accounts: dict[str, dict[str, int]] | None,
) -> list[Figure]:
    reason = "" if accounts is not None else "the session holds no accounts of a recorder"
    sums = [
        Figure(
            name=name,
            label=f"messages {name}",
            value=None if accounts is None else sum(row[name] for row in accounts.values()),
            reason=reason,
        )
        for name in ("offered", "dropped", "refused", "lost")
    ]
    gaps = sum(len(rhythm.gaps) for rhythm in rhythms)
    return [
        Figure(name="messages", label="messages in the session", value=messages),
        Figure(name="duration_s", label="duration", value=duration_s, unit="s"),
        *sums,
        Figure(name="gaps", label=f"pauses longer than {GAP_PERIODS:g} periods", value=gaps),
    ]


def _table(
    rhythms: list[_Rhythm], accounts: dict[str, dict[str, int]] | None
) -> tuple[dict[str, Any], dict[str, str]]:
    columns: dict[str, Any] = {
        "topic": np.array([rhythm.topic for rhythm in rhythms], dtype=object),
        "count": np.array([rhythm.count for rhythm in rhythms]),
        "period_s": np.array([rhythm.period_s for rhythm in rhythms]),
        "longest_gap_s": np.array([rhythm.longest_s for rhythm in rhythms]),
        "gaps": np.array([len(rhythm.gaps) for rhythm in rhythms]),
    }
    if accounts is not None:
        for name in ("dropped", "refused", "lost"):
            counts = [accounts.get(rhythm.topic, {}).get(name, 0) for rhythm in rhythms]
            columns[name] = np.array(counts)
    return columns, {"period_s": "s", "longest_gap_s": "s"}
