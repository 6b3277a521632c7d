"""The figures of a replay: recorded and predicted errors, and the self-check."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import FloatArray
from seamlog.results import Figure

from .counterfactual import Judge, Prediction
from .run import Replay


def rms_mm(error_m: FloatArray) -> float:
    """Root mean square in mm."""
    return 1e3 * float(np.sqrt(np.mean(error_m**2)))


def peak_mm(error_m: FloatArray) -> float:
    """Largest magnitude in mm."""
    return 1e3 * float(np.max(np.abs(error_m)))


JUDGES: dict[str, Judge] = {"rms": rms_mm, "peak": peak_mm}
UNSTABLE = "the predicted loop is unstable: its motion grows without bound"
_MISS_UNKNOWN = "the recorded controller is not known: how well the model predicts was not checked"


def replay_figures(found: Replay, judged: NDArray[np.bool_]) -> list[Figure]:
    """Self-check first, then rms and peak over the rows `judged`."""
    figures = [*_self_check_figures(found), *_recorded_figures(found, judged)]
    misses = unexplained_misses(found, judged)
    reason = found.model_reason or "only a shadow replay was asked for: it predicts no error"
    for run in found.controllers:
        label = f"{run.choice.name} (counterfactual)"
        figures += _error_figures(run.choice.name, label, run.prediction, judged, misses, reason)
    return figures


def model_misses(found: Replay, judged: NDArray[np.bool_]) -> dict[str, float] | None:
    """Relative difference of predicted and recorded figures under the recorded controller.

    None where that prediction could not be made. It is the model's error in a case whose answer
    is known.
    """
    if found.recorded is None:
        return None
    measured = found.record.error_m[judged]
    return {
        kind: abs(found.recorded.best(judge, judged) / judge(measured) - 1)
        for kind, judge in JUDGES.items()
    }


def unexplained_misses(found: Replay, judged: NDArray[np.bool_]) -> dict[str, float] | None:
    """What of `model_misses` the ensemble's spread does not contain already.

    It goes into the uncertainty of the cases whose answer is not known.
    """
    if found.recorded is None:
        return None
    measured, own = found.record.error_m[judged], found.recorded
    return {
        kind: unexplained_miss(judge(measured), own.judged(judge, judged))
        for kind, judge in JUDGES.items()
    }


def unexplained_miss(measured: float, predicted: FloatArray) -> float:
    """Relative miss of the recorded run beyond the spread of its predictions (members,)."""
    best = float(np.median(predicted))
    miss, spread = best / measured - 1, float(np.std(predicted, ddof=1)) / best
    return float(np.sqrt(max(0.0, miss**2 - spread**2)))


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
            figure = figure.model_copy(update=_judged(prediction, judge, kind, judged, misses))
        figures.append(figure)
    return figures


def _judged(
    prediction: Prediction,
    judge: Judge,
    kind: str,
    judged: NDArray[np.bool_],
    misses: dict[str, float] | None,
) -> dict[str, Any]:
    """Value, u and reason of one figure."""
    if not prediction.is_bounded:
        return {"reason": UNSTABLE}
    value, spread = prediction.best(judge, judged), prediction.spread(judge, judged)
    miss = 0.0 if misses is None else misses[kind] * value
    doubt = _MISS_UNKNOWN if misses is None else ""
    return {"value": value, "u": float(np.hypot(spread, miss)), "reason": doubt}


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
