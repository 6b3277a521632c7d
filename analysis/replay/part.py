"""A replay as a part of the results: one table per run, rms and peak errors, the self-check."""

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord
from seamlog.analysis.part_tables import Tables
from seamlog.results import Finding, Input, Part, Severity, worst
from seamlog.welds import Weld

from .check_original import OriginalCheck
from .check_part import check_criteria, check_findings
from .figures import UNSTABLE, model_misses, replay_figures
from .model import LARGEST_HIDDEN_EXCESS, AxisModel
from .run import Replay
from .settings import ReplaySettings
from .tables import replay_tables

LARGE_MISS = 0.2
"""Relative miss of the recorded run from which on the part warns."""
MUCH_SATURATED = 0.2
"""Share of saturated commands from which on the part warns."""
TOLERANCE = 1e-9
"""Largest difference of commands, relative to the largest command, that counts as reproduced."""


def replay_part(
    found: Replay,
    settings: ReplaySettings,
    welds: list[Weld],
    inputs: list[Input],
    check: OriginalCheck | None = None,
) -> tuple[Part, Tables]:
    """The part `replay` and its tables; errors are judged over the welds, if there are any.

    With `check` the part is judged by it.
    """
    judged = judged_rows(found.record, welds) & ~found.inputs.filled
    criteria = check_criteria(check) if check else []
    figures = replay_figures(found, judged)
    misses = model_misses(found, judged)
    where = "over the welds" if welds else "over the whole record"
    part = Part(
        part="replay",
        title="Replay",
        verdict=worst([criterion.verdict for criterion in criteria]),
        reason=f"compares controllers, judges none; rms and peak are {where}",
        criteria=criteria,
        inputs=inputs,
        configuration=settings.model_dump(mode="json"),
        figures=figures,
        findings=[
            *(check_findings(check) if check else []),
            *_findings(found),
            *_model_findings(misses),
        ],
        details=_details(found) | {"model_misses": misses, "members": settings.members},
    )
    return part, replay_tables(found)


def judged_rows(record: AxisRecord, welds: list[Weld]) -> NDArray[np.bool_]:
    """Rows within a weld; all rows of a record without welds."""
    rows = np.zeros(len(record), dtype=np.bool_)
    for weld in welds:
        rows |= (record.log_time_ns >= weld.start_ns) & (record.log_time_ns < weld.end_ns)
    return rows if rows.any() else np.ones(len(record), dtype=np.bool_)


def _findings(found: Replay) -> list[Finding]:
    messages = [(Severity.INFO, note) for note in found.inputs.notes]
    for run in found.controllers:
        messages += [(Severity.WARNING, f"{run.choice.name}: {text}") for text in run.warnings]
        if run.prediction is not None and not run.prediction.is_bounded:
            messages.append((Severity.WARNING, f"{run.choice.name}: {UNSTABLE}"))
        recorded = found.live is not None and found.live.name == run.choice.name
        if run.shadow is not None and not recorded:
            text = (
                f"the shadow replay of {run.choice.name} says what it would have commanded at the "
                "recorded moments; it predicts no tracking error"
            )
            messages.append((Severity.INFO, text))
    for watcher in found.estimators:
        if not np.isfinite(watcher.trace.parameters[-1]).all():
            text = f"{watcher.choice.name}: the estimate is no finite number at the end"
            messages.append((Severity.WARNING, text))
    if found.model is not None and found.model.delay_from == "assumption":
        text = (
            f"a delay of {found.model.axis.delay_periods} period between command and effect is "
            "assumed: neither the session nor the motion tells it"
        )
        messages.append((Severity.WARNING, text))
    if found.model is not None and found.model.hides_static_friction:
        text = (
            "the record does not tell static friction beyond Coulomb friction; the bands allow "
            f"for up to {100 * LARGEST_HIDDEN_EXCESS:.0f} % of it at low speed"
        )
        messages.append((Severity.INFO, text))
    share = float(found.record.saturated.mean())
    if share > MUCH_SATURATED:
        text = (
            f"{100 * share:.0f} % of the commands were at their limit: the record says little of "
            "what the controllers ask for"
        )
        messages.append((Severity.WARNING, text))
    if found.model_reason:
        messages.append((Severity.WARNING, f"no counterfactual: {found.model_reason}"))
    messages += _self_check_messages(found)
    return [Finding(severity=severity, message=text) for severity, text in messages]


def _model_findings(misses: dict[str, float] | None) -> list[Finding]:
    """How far the model may be trusted, in words."""
    if misses is None or max(misses.values()) <= LARGE_MISS:
        return []
    text = (
        f"the model misses the recorded run: rms by {100 * misses['rms']:.0f} %, peak by "
        f"{100 * misses['peak']:.0f} %; take its predictions as no better than that"
    )
    return [Finding(severity=Severity.WARNING, message=text)]


def _self_check_messages(found: Replay) -> list[tuple[Severity, str]]:
    check, largest = found.self_check, float(np.max(np.abs(found.record.command)))
    if check.shadow_difference is None:
        return [(Severity.WARNING, f"self-check not possible: {check.reason}")]
    messages = []
    if check.shadow_difference > TOLERANCE * largest:
        text = (
            "the recorded controller on the recorded measurements gives other commands than the "
            f"recorded ones, by up to {check.shadow_difference:.3g} {found.record.drive.unit}: "
            "messages are missing, or its configuration was another one"
        )
        messages.append((Severity.WARNING, text))
    return messages


def _details(found: Replay) -> dict[str, Any]:
    model = found.model
    return {
        "recorded_controller": found.live.name if found.live else None,
        "controllers": {run.choice.name: run.choice.config for run in found.controllers},
        "estimators": {run.choice.name: run.choice.config for run in found.estimators},
        "axis": None if model is None else _axis(model.axis),
        "identified_by": None if model is None else model.method,
        "delay_from": None if model is None else model.delay_from,
        "ripple": None if model is None else asdict(model.ripple),
        "friction_laws": [] if model is None else _laws(model),
    }


def _laws(model: AxisModel) -> list[dict[str, Any]]:
    """The explanations that the ensemble draws from, with standard deviations."""
    return [
        {
            "stribeck_power": found.shape.stribeck_power if found.value("excess") else None,
            "likelihood": found.weight,
            "values": dict(zip(found.names, found.values.tolist(), strict=True)),
            "sd": dict(zip(found.names, np.sqrt(np.diag(found.covariance)).tolist(), strict=True)),
        }
        for found in model.explanations
    ]


def _axis(axis: Any) -> dict[str, Any]:
    values = {name: getattr(axis, name) for name in axis.__slots__}
    return {key: None if value == float("inf") else value for key, value in values.items()}
