"""Inspection record: visual method of ISO 17637, acceptance of ISO 5817; missing is said."""

from collections.abc import Iterator, Sequence
from typing import Any

from seamlog.reports.content import AnyBlock, Fact, FactTable, Text
from seamlog.reports.run import Run, utc_date
from seamlog.reports.verdicts import limits_text

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
    ("Calibration", ("calibration",)),
    ("Age of the calibration", ("calibration_age",)),
    ("Lighting", ("lighting", "illuminance")),
)
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
    facts.append(Fact(label="Limits", value=_limits(run)))
    facts += [Fact(label=label, value=stated.get(label.lower())) for label in _SIGNATURES]
    return facts


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
