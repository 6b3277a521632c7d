"""Inspection record: visual method of ISO 17637, acceptance of ISO 5817; missing is said."""

from collections.abc import Iterator, Sequence
from datetime import date
from typing import Any

from seamlog.reports.content import AnyBlock, Fact, FactTable, Text
from seamlog.reports.numbers import format_quantity
from seamlog.reports.run import Run, utc_date
from seamlog.reports.verdicts import limits_text, sentence
from seamlog.results import Severity, Verdict

_FIELDS = (
    ("Weld or part", ("part", "weld_id")),
    ("Drawing", ("drawing",)),
    ("Welding procedure (WPS)", ("wps",)),
    ("Welding process", ("process",)),
    ("Joint", ("joint",)),
    ("Material", ("material",)),
    ("Thickness in mm", ("thickness_mm",)),
    ("Welding position", ("position",)),
    ("Filler", ("filler",)),
    ("Shielding gas", ("shielding_gas",)),
    ("Acceptance level (ISO 5817)", ("acceptance_level", "level")),
    ("Camera", ("camera",)),
    ("Lighting (ISO 17637: 350 lx at least)", ("lighting", "illuminance", "illuminance_lx")),
)
_AGE = "Age of the calibration at the weld"
_MOST_FINDINGS = 10
_SIGNATURES = ("Operator", "Inspector", "Approver")
_METHOD = (
    "Method as ISO 17637 (visual testing), acceptance as ISO 5817 where a level is given. ISO 5817 "
    "has no limit for irregular width: widths are judged against the user's own limits."
)


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Who, what, by which procedure and how it was looked at, per results directory."""
    blocks: list[AnyBlock] = [Text(text=_METHOD)]
    blocks += [
        FactTable(caption=f"Inspection record of {run.label}", facts=_facts(run)) for run in runs
    ]
    return blocks


def _facts(run: Run) -> list[Fact]:
    stated = dict(_stated(run))
    end_ns = run.end_ns()
    facts = [Fact(label="End of the weld", value=utc_date(end_ns) if end_ns else None)]
    for label, keys in _FIELDS:
        value = next((stated[key] for key in keys if key in stated), None)
        facts.append(Fact(label=label, value=value))
    facts += _calibration(run, stated)
    facts.append(Fact(label="Limits", value=_limits(run)))
    facts.append(Fact(label="Findings", value=_findings(run)))
    facts += [Fact(label=label, value=stated.get(label.lower())) for label in _SIGNATURES]
    return facts


def _calibration(run: Run, stated: dict[str, str]) -> list[Fact]:
    """What turned pixels into millimetres, how good it is, and how old it was at the weld."""
    known = next(
        (part.details["calibration"] for part in run.of("bead") if "calibration" in part.details),
        None,
    )
    if not isinstance(known, dict):
        said, age = stated.get("calibration"), stated.get("calibration_age")
        return [Fact(label="Calibration", value=said), Fact(label=_AGE, value=age)]
    words = [str(known[key]) for key in ("kind", "source") if known.get(key)]
    for key, text, unit in (
        ("residual_mm", "residual", "mm"),
        ("scale_relative_u", "relative u of the scale", ""),
    ):
        if isinstance(value := known.get(key), int | float):
            words.append(f"{text} {format_quantity(float(value), unit=unit)}")
    return [
        Fact(label="Calibration", value=", ".join(words) or None),
        Fact(label=_AGE, value=_age(known.get("date"), run.end_ns())),
    ]


def _age(day: Any, end_ns: int | None) -> str | None:
    """Days from the calibration to the end of the weld."""
    try:
        made = date.fromisoformat(str(day)[:10])
    except ValueError:
        return None
    if end_ns is None:
        return f"of {made}; the day of the weld is not recorded"
    days = (date.fromisoformat(utc_date(end_ns)) - made).days
    return f"{days} days (of {made})" if days >= 0 else f"of {made}, after the weld"


def _findings(run: Run) -> str:
    """What was found, each with its value and its place."""
    found = [
        (sentence(item), run.place(part, item.place))
        for part in run.parts
        for item in part.criteria
        if item.verdict is Verdict.FAIL
    ]
    for part in run.parts:
        lines = run.lines(part, part.findings)
        found += [(i.message, i.place) for i in lines if i.severity is not Severity.INFO]
    told = [f"{text} ({place.text})" if place else text for text, place in found[:_MOST_FINDINGS]]
    more = len(found) - len(told)
    judged = any(i.verdict is Verdict.PASS for part in run.parts for i in part.criteria)
    nothing = "none" if judged else "none; nothing was judged"
    return "; ".join([*told, *([f"{more} more below"] if more else [])]) or nothing


def _stated(run: Run) -> Iterator[tuple[str, str]]:
    """What the parts' details say about the weld, flat or, which counts more, as metadata."""
    for source in (
        *(part.details for part in run.parts),
        *(part.details.get("metadata") for part in run.parts),
    ):
        if isinstance(source, dict):
            yield from _plain(source)


def _plain(source: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for key, value in source.items():
        if isinstance(value, str | int | float) and not isinstance(value, bool) and value != "":
            yield key, str(value)


def _limits(run: Run) -> str | None:
    texts = [
        f"{criterion.label} {limits}"
        for part in run.parts
        for criterion in part.criteria
        if (limits := limits_text(criterion))
    ]
    return "; ".join(texts) or None
