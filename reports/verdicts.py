"""The overall verdict: the worst of what was assessed; what was not is said beside it."""

from collections.abc import Iterable, Sequence

from seamlog.results import Criterion, Part, Severity, Verdict, worst

from .content import Banner, FindingLine, Statement
from .numbers import format_quantity
from .run import KINDS, Run, anchor

_ASSESSED = (Verdict.PASS, Verdict.FAIL)


def overall(runs: Sequence[Run]) -> Banner:
    """Verdict over all parts of all runs, with the failed criteria and each part's statement."""
    parts = [(run, part) for run in runs for part in run.parts]
    assessed = [part.verdict for _, part in parts if part.verdict in _ASSESSED]
    verdict = worst(assessed)
    return Banner(
        verdict=verdict,
        summary=_summary(verdict, [part for _, part in parts]),
        reasons=_distinct(line for run, part in parts for line in _failures(run, part)),
        statements=_statements(runs),
    )


def sentence(criterion: Criterion) -> str:
    """What a criterion says, as one line: value, limits, reason."""
    words = criterion.label
    if criterion.value is not None:
        words += f": {format_quantity(criterion.value, criterion.u, criterion.unit)}"
    limits = limits_text(criterion)
    words += f" (limit {limits})" if limits else ""
    return f"{words}; {criterion.reason}" if criterion.reason else words


def limits_text(criterion: Criterion) -> str:
    """The limits of a criterion as text, '' if it has none."""
    lower = None if criterion.lower is None else format_quantity(criterion.lower)
    upper = None if criterion.upper is None else format_quantity(criterion.upper)
    unit = f" {criterion.unit}" if criterion.unit and criterion.unit != "1" else ""
    if lower is not None and upper is not None:
        return f"{lower} to {upper}{unit}"
    if upper is not None:
        return f"at most {upper}{unit}"
    return f"at least {lower}{unit}" if lower is not None else ""


def _summary(verdict: Verdict, parts: list[Part]) -> str:
    criteria = [criterion for part in parts for criterion in part.criteria]
    if verdict in _ASSESSED:
        return _counted(verdict, criteria) or f"A part says {verdict.value}."
    if criteria:
        return "None of the limits could be assessed."
    return "No limits were given, so nothing was judged. The figures below are measured values."


def _counted(verdict: Verdict, criteria: Sequence[Criterion]) -> str:
    """How many of the limits that were assessed are met; '' if there is none to count."""
    judged = [c.verdict for c in criteria if c.verdict in _ASSESSED]
    failed = judged.count(Verdict.FAIL)
    if verdict is Verdict.FAIL and failed:
        one = "The limit is not met."
        return one if len(judged) == 1 else f"{failed} of {len(judged)} limits are not met."
    if verdict is Verdict.PASS and judged:
        return "The limit is met." if len(judged) == 1 else f"All {len(judged)} limits are met."
    return ""


def _distinct(lines: Iterable[FindingLine]) -> list[FindingLine]:
    """Each reason once: two parts may judge one figure by one limit."""
    return list(
        {line.model_dump_json(exclude={"place": {"section"}}): line for line in lines}.values()
    )


def _failures(run: Run, part: Part) -> list[FindingLine]:
    failed = [c for c in part.criteria if c.verdict is Verdict.FAIL]
    lines = [
        FindingLine(severity=Severity.FAULT, message=sentence(c), place=run.place(part, c.place))
        for c in failed
    ]
    if not lines and part.verdict is Verdict.FAIL:
        message = f"{part.title}: {part.reason or 'failed'}"
        lines.append(FindingLine(severity=Severity.FAULT, message=message))
    return lines


def _statements(runs: Sequence[Run]) -> list[Statement]:
    """One statement per part, and per kind of part that some or all runs lack."""
    several = len(runs) > 1
    found = []
    for kind in _kinds(runs):
        for run in runs:
            prefix = f"{run.label}: " if several else ""
            found += [statement(part, prefix) for part in run.of(kind)]
        without = [run for run in runs if not run.of(kind)]
        if len(without) == len(runs):
            found.append(_missing(kind, ""))
        elif kind in KINDS:
            found += [_missing(kind, f"{run.label}: ") for run in without]
    return found


def _kinds(runs: Sequence[Run]) -> list[str]:
    known = {part.part for run in runs for part in run.parts}
    return [*KINDS, *sorted(known - set(KINDS))]


def statement(part: Part, prefix: str = "") -> Statement:
    """A part's verdict and its reason."""
    unlimited = "" if part.criteria or part.verdict in _ASSESSED else "No limits were given."
    return Statement(
        subject=prefix + part.title,
        verdict=part.verdict,
        reason=part.reason or _counted(part.verdict, part.criteria) or unlimited,
        section=anchor(part.part),
    )


def grouped(statements: Sequence[Statement]) -> list[tuple[Verdict, list[Statement]]]:
    """Statements by verdict, in the order FAIL, PASS, then what was not assessed."""
    order = (Verdict.FAIL, Verdict.PASS, Verdict.NOT_MEASURABLE, Verdict.NOT_ASSESSED)
    groups = [(verdict, [s for s in statements if s.verdict is verdict]) for verdict in order]
    return [(verdict, members) for verdict, members in groups if members]


def _missing(kind: str, prefix: str) -> Statement:
    return Statement(
        subject=prefix + KINDS[kind],
        verdict=Verdict.NOT_ASSESSED,
        reason="not recorded: the results hold no such part",
        section=kind,
        missing=True,
    )
