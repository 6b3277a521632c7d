"""Runs set beside the first of them: figures, limits, and what became worse beyond a tolerance.

A figure regresses if larger is worse for it and it grew by more than its tolerance and by more than
the expanded uncertainty of the difference. A limit regresses if it was met and no longer is, or can
no longer be told. A curve of errors regresses if its mean magnitude grew beyond the tolerance with
95 % confidence.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from seamlog.errors import UnknownName
from seamlog.plugins import unknown_name
from seamlog.results import Criterion, Figure, Part, Verdict

from .block import Block
from .numbers import COVERAGE
from .pairing import Paired, Shared, pair, shared_columns
from .run import Run
from .tolerances import Tolerances

WORSE_LARGER = (
    "_error_mm",
    "dropped",
    "refused",
    "lost",
    "gaps",
    "width_std_mm",
    "width_std_px",
    "width_range_mm",
    "width_range_px",
    "width_cv",
    "peak_to_peak_25mm",
    "excursions",
    "spatter_count",
    "spatter_per_100mm",
    "spatter_area_mm2",
    "gap_length_mm",
)
"""Endings of figures for which larger is worse; all others are shown and not judged."""
_MAGNITUDE = "mean_error_mm"
"""A mean of signed errors: its distance from zero counts."""


class Change(Block):
    """One figure in all runs; `regressed` holds the labels of the runs in which it got worse."""

    part: str
    index: int
    figures: list[Figure | None]
    judged: bool
    regressed: list[str]

    @property
    def base(self) -> Figure:
        """The first run's figure."""
        assert self.figures[0] is not None
        return self.figures[0]


class Judged(Block):
    """One limit in all runs."""

    part: str
    index: int
    label: str
    verdicts: list[Verdict | None]
    regressed: list[str]


@dataclass(frozen=True)
class Comparison:
    """All that was compared, and the regressions in words."""

    labels: list[str]
    changes: list[Change]
    limits: list[Judged]
    shared: list[Shared]
    paired: list[Paired]
    regressions: list[str]
    unknown: list[str]
    """What the base knows and another run does not: never counted as unchanged."""

    @property
    def verdict(self) -> Verdict:
        """FAIL with a regression; NOT ASSESSED where nothing could be judged."""
        if self.regressions:
            return Verdict.FAIL
        judged = any(change.judged for change in self.changes) or any(self.limits)
        return Verdict.PASS if judged else Verdict.NOT_ASSESSED


def compare_runs(runs: Sequence[Run], tolerances: Tolerances) -> Comparison:
    """Every other run against the first; labels that are alike get the number of their run."""
    shared = list(shared_columns(runs))
    _check_names(runs[0], shared, tolerances)
    labels = distinct_labels(runs)
    changes = [
        change for part in runs[0].parts for change in _changes(runs, labels, part, tolerances)
    ]
    limits = [limit for part in runs[0].parts for limit in _limits(runs, labels, part)]
    named = dict(zip((id(run) for run in runs), labels, strict=True))
    paired = [
        item.model_copy(update={"run": label})
        for each in shared
        for item, label in zip(pair(each, runs), _others(each, runs, named), strict=True)
    ]
    return Comparison(
        labels,
        changes,
        limits,
        shared,
        paired,
        [*_told(changes, limits), *_told_pairs(shared, paired, tolerances)],
        [
            f"{_name(c)}: not known in {label}"
            for c in changes
            if c.judged
            for label, figure in zip(labels, c.figures, strict=True)
            if _value(figure) is None
        ],
    )


def _check_names(base: Run, shared: Sequence[Shared], tolerances: Tolerances) -> None:
    """A tolerance of a figure that is not there would be ignored: it is refused."""
    known = {figure.name for part in base.parts for figure in part.figures}
    known |= {each.column for each in shared if each.is_error}
    for name in tolerances.named:
        if name not in known:
            raise UnknownName(unknown_name("figures", name, sorted(known)))


def distinct_labels(runs: Sequence[Run]) -> list[str]:
    """The runs' labels, told apart by the folder where the sessions have one name."""
    labels = [run.label for run in runs]
    if len(set(labels)) < len(labels):
        labels = [run.results.folder.resolve().name for run in runs]
    if len(set(labels)) < len(labels):
        labels = [f"{label} ({number})" for number, label in enumerate(labels, 1)]
    return labels


def _others(shared: Shared, runs: Sequence[Run], named: dict[int, str]) -> list[str]:
    curves = zip(runs[1:], shared.curves[1:], strict=True)
    return [named[id(run)] for run, curve in curves if curve is not None]


def _same(run: Run, part: Part) -> Part | None:
    return next((other for other in run.of(part.part) if other.index == part.index), None)


def _changes(
    runs: Sequence[Run], labels: Sequence[str], part: Part, tolerances: Tolerances
) -> list[Change]:
    found = []
    for figure in part.figures:
        if _value(figure) is None:
            continue
        others = [_same(run, part) for run in runs]
        figures = [other.figure(figure.name) if other else None for other in others]
        judged = figure.name.endswith(WORSE_LARGER)
        worse = [
            label
            for label, other in zip(labels[1:], figures[1:], strict=True)
            if judged and other is not None and _is_worse(figure, other, tolerances)
        ]
        found.append(
            Change(
                part=part.part, index=part.index, figures=figures, judged=judged, regressed=worse
            )
        )
    return found


def _is_worse(base: Figure, other: Figure, tolerances: Tolerances) -> bool:
    first, second = _value(base), _value(other)
    if first is None or second is None or base.unit != other.unit:
        return False
    if base.name == _MAGNITUDE:
        first, second = abs(first), abs(second)
    doubt = COVERAGE * math.hypot(base.u or 0.0, other.u or 0.0)
    return second - first > max(tolerances.of(base.name).allowed(first), doubt)


def _limits(runs: Sequence[Run], labels: Sequence[str], part: Part) -> list[Judged]:
    return [
        _judged(item, [_same(run, part) for run in runs], labels, part) for item in part.criteria
    ]


def _judged(
    item: Criterion, parts: Sequence[Part | None], labels: Sequence[str], part: Part
) -> Judged:
    verdicts = [
        next((c.verdict for c in other.criteria if c.name == item.name), None) if other else None
        for other in parts
    ]
    lost = [
        label
        for label, verdict in zip(labels[1:], verdicts[1:], strict=True)
        if item.verdict is Verdict.PASS and verdict is not Verdict.PASS
    ]
    return Judged(
        part=part.part, index=part.index, label=item.label, verdicts=verdicts, regressed=lost
    )


def _told(changes: Sequence[Change], limits: Sequence[Judged]) -> list[str]:
    grown = [f"{_name(c)} is worse in {', '.join(c.regressed)}" for c in changes if c.regressed]
    lost = [
        f"{limit.part}: the limit on {limit.label} was met and is not any more in "
        f"{', '.join(limit.regressed)}"
        for limit in limits
        if limit.regressed
    ]
    return [*lost, *grown]


def _told_pairs(
    shared: Sequence[Shared], paired: Sequence[Paired], tolerances: Tolerances
) -> list[str]:
    errors = {(s.part.part, s.part.index, s.table, s.column) for s in shared if s.is_error}
    return [
        f"{item.part}, {item.table}: {item.label} is larger in {item.run}, pair by pair"
        for item in paired
        if (item.part, item.index, item.table, item.column) in errors
        and item.low is not None
        and item.base_mean is not None
        and item.low > tolerances.of(item.column).allowed(item.base_mean)
    ]


def _name(change: Change) -> str:
    return f"{change.part}: {change.base.label}"


def _value(figure: Figure | None) -> float | None:
    if figure is None or isinstance(figure.value, str) or figure.value is None:
        return None
    return float(figure.value)
