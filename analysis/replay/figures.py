"""The figures of a replay: recorded and predicted errors, and the self-check."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import FloatArray
from seamlog.results import Figure

from .counterfactual import Prediction
from .run import Replay

Judge = Callable[[FloatArray], float]


def rms_mm(error_m: FloatArray) -> float:
    """Root mean square in mm."""
    return 1e3 * float(np.sqrt(np.mean(error_m**2)))


def peak_mm(error_m: FloatArray) -> float:
    """Largest magnitude in mm."""
    return 1e3 * float(np.max(np.abs(error_m)))


JUDGES: dict[str, Judge] = {"rms": rms_mm, "peak": peak_mm}
_MISS_UNKNOWN = "the recorded controller is not known: how well the model predicts was not checked"


def replay_figures(found: Replay, judged: NDArray[np.bool_]) -> list[Figure]:
    """Self-check first, then rms and peak over the rows `judged`."""
    figures = [*_self_check_figures(found), *_recorded_figures(found, judged)]
    misses = model_misses(found, judged)
    reason = found.model_reason or "only a shadow replay was asked for: it predicts no error"
    for run in found.controllers:
        label = f"{run.choice.name} (counterfactual)"
        figures += _error_figures(run.choice.name, label, run.prediction, judged, misses, reason)
    return figures


def model_misses(found: Replay, judged: NDArray[np.bool_]) -> dict[str, float] | None:
    """Relative difference of predicted and recorded figures under the recorded controller.

    None where that prediction could not be made. It is the model's error in a case whose answer
    is known, and goes into the uncertainty of the cases whose answer is not.
    """
    if found.recorded is None:
        return None
    measured, predicted = found.record.error_m[judged], found.recorded.error_m[judged]
    return {kind: abs(judge(predicted) / judge(measured) - 1) for kind, judge in JUDGES.items()}


def _recorded_figures(found: Replay, judged: NDArray[np.bool_]) -> list[Figure]:
    error = found.record.error_m[judged]
    measured = [
        Figure(
            name=f"recorded_{kind}_error_mm",
            label=f"{kind} tracking error, recorded",
            value=judge(error),
            unit="mm",
        )
        for kind, judge in JUDGES.items()
    ]
    if found.recorded is None:
        return measured
    label = "recorded controller as the model predicts it"
    none = dict.fromkeys(JUDGES, 0.0)
    return measured + _error_figures("recorded_predicted", label, found.recorded, judged, none, "")


def _error_figures(
    name: str,
    label: str,
    prediction: Prediction | None,
    judged: NDArray[np.bool_],
    misses: dict[str, float] | None,
    reason: str,
) -> list[Figure]:
    figures = []
    for kind, judge in JUDGES.items():
        figure = Figure(
            name=f"{name}_{kind}_error_mm",
            label=f"{kind} tracking error, {label}",
            value=None,
            unit="mm",
            reason=reason,
        )
        if prediction is not None:
            value, spread = prediction.figure(judge, judged)
            miss = 0.0 if misses is None else misses[kind] * value
            doubt = _MISS_UNKNOWN if misses is None else ""
            update = {"value": value, "u": float(np.hypot(spread, miss)), "reason": doubt}
            figure = figure.model_copy(update=update)
        figures.append(figure)
    return figures


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
