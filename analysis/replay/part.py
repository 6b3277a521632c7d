"""A replay as a part of the results: one table per run, rms and peak errors, the self-check."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.analysis.part_tables import Tables
from seamlog.results import Figure, Finding, Input, Part, Severity
from seamlog.welds import Weld

from .counterfactual import Prediction
from .run import ControllerRun, Replay
from .settings import ReplaySettings
from .tables import replay_tables

TOLERANCE = 1e-9
"""Largest difference of commands, relative to the largest command, that counts as reproduced."""


def replay_part(
    found: Replay, settings: ReplaySettings, welds: list[Weld], inputs: list[Input]
) -> tuple[Part, Tables]:
    """The part `replay` and its tables; errors are judged over the welds, if there are any."""
    judged = judged_rows(found.record, welds)
    figures = [
        *_self_check_figures(found),
        *_recorded_figures(found, judged),
        *(figure for run in found.controllers for figure in _figures(run, found, judged)),
    ]
    where = "over the welds" if welds else "over the whole record"
    part = Part(
        part="replay",
        title="Replay",
        reason=f"compares controllers, judges none; rms and peak are {where}",
        inputs=inputs,
        configuration=settings.model_dump(mode="json"),
        figures=figures,
        findings=_findings(found),
        details=_details(found),
    )
    return part, replay_tables(found)


def judged_rows(record: AxisRecord, welds: list[Weld]) -> NDArray[np.bool_]:
    """Rows within a weld; all rows of a record without welds."""
    rows = np.zeros(len(record), dtype=np.bool_)
    for weld in welds:
        rows |= (record.log_time_ns >= weld.start_ns) & (record.log_time_ns < weld.end_ns)
    return rows if rows.any() else np.ones(len(record), dtype=np.bool_)


def rms_mm(error_m: FloatArray) -> float:
    """Root mean square in mm."""
    return 1e3 * float(np.sqrt(np.mean(error_m**2)))


def peak_mm(error_m: FloatArray) -> float:
    """Largest magnitude in mm."""
    return 1e3 * float(np.max(np.abs(error_m)))


def _error_figures(
    name: str, label: str, prediction: Prediction | None, judged: NDArray[np.bool_], reason: str
) -> list[Figure]:
    figures = []
    for kind, judge in (("rms", rms_mm), ("peak", peak_mm)):
        value, u = prediction.figure(judge, judged) if prediction else (None, None)
        figures.append(
            Figure(
                name=f"{name}_{kind}_error_mm",
                label=f"{kind} tracking error, {label}",
                value=value,
                unit="mm",
                u=u,
                reason="" if prediction else reason,
            )
        )
    return figures


def _figures(run: ControllerRun, found: Replay, judged: NDArray[np.bool_]) -> list[Figure]:
    name = run.choice.name
    reason = found.model_reason or "only a shadow replay was asked for: it predicts no error"
    return _error_figures(name, f"{name} (counterfactual)", run.prediction, judged, reason)


def _recorded_figures(found: Replay, judged: NDArray[np.bool_]) -> list[Figure]:
    error = found.record.error_m[judged]
    measured = [
        Figure(
            name=f"recorded_{kind}_error_mm",
            label=f"{kind} tracking error, recorded",
            value=judge(error),
            unit="mm",
        )
        for kind, judge in (("rms", rms_mm), ("peak", peak_mm))
    ]
    if found.recorded is None:
        return measured
    label = "recorded controller as the model predicts it"
    return measured + _error_figures("recorded_predicted", label, found.recorded, judged, "")


def _self_check_figures(found: Replay) -> list[Figure]:
    check, unit = found.self_check, found.record.drive.unit
    position = check.position_difference_m
    return [
        Figure(
            name="self_check_shadow_difference",
            label="self-check: recorded controller on recorded measurements, largest difference",
            value=check.shadow_difference,
            unit=unit,
            reason="" if check.shadow_difference is not None else check.reason,
        ),
        Figure(
            name="self_check_command_difference",
            label="self-check: commands after abduction, largest difference",
            value=check.command_difference,
            unit=unit,
            reason="" if check.command_difference is not None else check.reason,
        ),
        Figure(
            name="self_check_position_difference_mm",
            label="self-check: measured positions after abduction, largest difference",
            value=None if position is None else 1e3 * position,
            unit="mm",
            reason="" if position is not None else check.reason,
        ),
    ]


def _findings(found: Replay) -> list[Finding]:
    messages = [(Severity.INFO, note) for note in found.inputs.notes]
    for run in found.controllers:
        messages += [(Severity.WARNING, f"{run.choice.name}: {text}") for text in run.warnings]
        recorded = found.live is not None and found.live.name == run.choice.name
        if run.shadow is not None and not recorded:
            text = (
                f"the shadow replay of {run.choice.name} says what it would have commanded at the "
                "recorded moments; it predicts no tracking error"
            )
            messages.append((Severity.INFO, text))
    if found.model_reason:
        messages.append((Severity.WARNING, f"no counterfactual: {found.model_reason}"))
    messages += _self_check_messages(found)
    return [Finding(severity=severity, message=text) for severity, text in messages]


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
    }


def _axis(axis: Any) -> dict[str, Any]:
    values = {name: getattr(axis, name) for name in axis.__slots__}
    return {key: None if value == float("inf") else value for key, value in values.items()}
