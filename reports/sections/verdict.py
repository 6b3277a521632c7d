"""First screen: is this weld good, where not, why, and what would have helped."""

from collections.abc import Iterable, Sequence

from seamlog.reports.advice import advice
from seamlog.reports.content import AnyBlock, FindingLine, Findings, KeyFigures
from seamlog.reports.moment import moment_of
from seamlog.reports.run import Run
from seamlog.reports.verdicts import overall
from seamlog.results import Figure, Severity

_KEYS = (
    ("bead", ("width_mean_mm", "width_std_mm", "width_range_mm", "width_mean_px", "width_std_px")),
    ("tracking", ("rms_error_mm", "peak_error_mm")),
    ("health", ("dropped",)),
)
"""Figures for the first screen, those that are there."""
_OTHERWISE = (("identification", ("inertia", "viscous_friction", "coulomb_friction", "offset")),)
"""Figures for the first screen of results without any of these."""
_RANKS = {Severity.FAULT: 0, Severity.WARNING: 1, Severity.INFO: 2}
_MOST_LINES = 6


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """The verdict, the key figures and what went wrong where."""
    blocks: list[AnyBlock] = [overall(runs), *_what_went_wrong(runs), *_what_would_help(runs)]
    blocks += [moment for run in runs if (moment := moment_of(run)) is not None]
    blocks += [KeyFigures(figures=found) for run in runs if (found := _key_figures(run))]
    return blocks


def _what_would_help(runs: Sequence[Run]) -> list[AnyBlock]:
    lines = [FindingLine(severity=Severity.INFO, message=text) for text in advice(runs)]
    return [Findings(caption="What would have helped", findings=lines)] if lines else []


def _key_figures(run: Run) -> list[Figure]:
    return _chosen(run, _KEYS) or _chosen(run, _OTHERWISE)


def _chosen(run: Run, keys: Iterable[tuple[str, Sequence[str]]]) -> list[Figure]:
    return [
        figure
        for kind, names in keys
        for part in run.of(kind)[:1]
        for name in names
        if (figure := part.figure(name)) is not None
    ]


def _what_went_wrong(runs: Sequence[Run]) -> list[AnyBlock]:
    lines = [
        line
        for run in runs
        for kind in ("join", "bead", "tracking", "health")
        for part in run.of(kind)
        for line in run.lines(part, part.findings)
        if kind == "join" or line.severity is not Severity.INFO
    ]
    worst_first = sorted(lines, key=lambda line: _RANKS[line.severity])
    if not lines:
        return []
    caption = "What went wrong, where and why"
    if len(lines) > _MOST_LINES:
        caption += f" (the first {_MOST_LINES} of {len(lines)} findings; all stand below)"
    return [Findings(caption=caption, findings=worst_first[:_MOST_LINES])]
