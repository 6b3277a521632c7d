"""A study of the gauge as a part of the results."""

from collections.abc import Mapping, Sequence

import numpy as np

from seamlog.results import Columns, Criterion, Figure, Input, Part, Verdict, worst

from .anova import GaugeRR
from .study import Study

GOOD_PERCENT, FEWEST_CATEGORIES = 10.0, 5
_ALONE = "one operator: nothing is said on reproducibility"


def gauge_part(
    study: Study, found: GaugeRR, tolerance: float | None = None, inputs: Sequence[Input] = ()
) -> tuple[Part, Mapping[str, tuple[Columns, Mapping[str, str]]]]:
    """Part `gauge` with the table `trials`; judged by AIAG's 10 % and 5 categories."""
    criteria = _criteria(found, tolerance)
    parts, operators, trials = found.shape
    part = Part(
        part="gauge",
        title=f"Gauge R&R, {study.what}",
        inputs=list(inputs),
        verdict=worst([criterion.verdict for criterion in criteria]),
        reason=f"{parts} parts x {operators} operators x {trials} trials",
        figures=_figures(study, found, tolerance),
        criteria=criteria,
        details={"parts": list(study.parts), "operators": list(study.operators)},
    )
    return part, {"trials": _table(study)}


def _criteria(found: GaugeRR, tolerance: float | None) -> list[Criterion]:
    percent, classes = found.percent_grr, found.categories
    criteria = [
        Criterion(
            name="percent_grr", label="%GRR of the total variation", value=percent, unit="%",
            upper=GOOD_PERCENT, verdict=_verdict(percent <= GOOD_PERCENT),
        ),
        Criterion(
            name="ndc", label="Distinct categories", value=classes, unit="1",
            lower=FEWEST_CATEGORIES, verdict=_verdict(classes >= FEWEST_CATEGORIES),
        ),
    ]  # fmt: skip
    if tolerance is not None:
        share = found.percent_tolerance(tolerance)
        criteria.append(
            Criterion(
                name="percent_tolerance", label="6 GRR of the tolerance", value=share, unit="%",
                upper=GOOD_PERCENT, verdict=_verdict(share <= GOOD_PERCENT),
            )
        )  # fmt: skip
    return criteria


def _verdict(holds: bool) -> Verdict:
    return Verdict.PASS if holds else Verdict.FAIL


def _figures(study: Study, found: GaugeRR, tolerance: float | None) -> list[Figure]:
    unit = study.unit
    interval = (
        f"90 % interval {found.repeatability_low:.3g} to {found.repeatability_high:.3g} {unit}"
    )
    alone = _ALONE if found.shape[1] == 1 else ""
    p = found.interaction_p
    tested = "pooled with the repeatability" if found.pooled else "significant"
    shown = {
        f"repeatability_{unit}": ("Repeatability EV", found.repeatability, interval),
        f"reproducibility_{unit}": (
            "Reproducibility AV", None if alone else found.reproducibility, alone,
        ),
        f"gauge_{unit}": ("Gauge GRR", found.gauge, alone),
        f"parts_{unit}": ("Parts PV", found.parts, ""),
        f"total_{unit}": ("Total TV", found.total, ""),
    }  # fmt: skip
    figures = [
        Figure(name=name, label=f"{label}, standard deviation", value=value, unit=unit, reason=why)
        for name, (label, value, why) in shown.items()
    ]
    figures += [
        Figure(name="percent_grr", label="%GRR", value=found.percent_grr, unit="%", reason=alone),
        Figure(name="ndc", label="Distinct categories", value=found.categories, unit="1"),
        Figure(
            name="interaction_p", label="Interaction of part and operator, p", value=p, unit="1",
            reason=tested if p is not None else "no interaction to test",
        ),
    ]  # fmt: skip
    if tolerance is not None:
        share = found.percent_tolerance(tolerance)
        label = "6 GRR of the tolerance"
        figures.append(Figure(name="percent_tolerance", label=label, value=share, unit="%"))
    return figures


def _table(study: Study) -> tuple[Columns, Mapping[str, str]]:
    p, o, n = study.values.shape
    part, operator, trial = (index.ravel() for index in np.indices((p, o, n)))
    columns = {
        "part": np.array(study.parts, dtype=object)[part],
        "operator": np.array(study.operators, dtype=object)[operator],
        "trial": trial + 1,
        f"width_{study.unit}": study.values.ravel(),
    }
    return columns, {f"width_{study.unit}": study.unit}
