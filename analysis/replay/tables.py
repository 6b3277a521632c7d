"""The tables of a replay: one per run, over the same stamps."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.analysis.part_tables import Tables

from .counterfactual import Prediction
from .run import ControllerRun, EstimatorRun, Replay

_PARAMETERS = ("inertia", "viscous_friction", "coulomb_friction")


def replay_tables(found: Replay) -> Tables:
    """`recorded`, each controller and each estimator, with their units."""
    record = found.record
    unit = record.drive.unit
    tables: Tables = {
        "recorded": (
            {
                "stamp_ns": record.stamp_ns,
                "error_mm": 1e3 * record.error_m,
                "command": record.command,
            },
            {"stamp_ns": "ns", "error_mm": "mm", "command": unit},
        )
    }
    for run in found.controllers:
        tables[run.choice.name] = _controller_table(run, record, found.recorded)
    for watcher in found.estimators:
        name = watcher.choice.name
        key = f"estimator_{name}" if name in tables else name
        tables[key] = _estimator_table(watcher, record)
    return tables


def _controller_table(
    run: ControllerRun, record: AxisRecord, recorded: Prediction | None
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    unit = record.drive.unit
    columns: dict[str, NDArray[Any]] = {"stamp_ns": record.stamp_ns}
    units = {"stamp_ns": "ns"}
    if run.prediction is not None:
        low_m, high_m = whole_band_m(run.prediction, record, recorded)
        columns["error_mm"] = 1e3 * run.prediction.error_m
        columns["band_low_mm"], columns["band_high_mm"] = 1e3 * low_m, 1e3 * high_m
        columns["command"] = run.prediction.run.command
    if run.shadow is not None:
        columns["shadow_command"] = run.shadow.command
    lengths = ("error_mm", "band_low_mm", "band_high_mm")
    return columns, units | dict.fromkeys(lengths, "mm") | {
        "command": unit,
        "shadow_command": unit,
    }


def whole_band_m(
    prediction: Prediction, record: AxisRecord, recorded: Prediction | None
) -> tuple[FloatArray, FloatArray]:
    """90 % band of the error: that of the ensemble, widened by what the model misses anyway.

    The miss is the difference of record and prediction under the recorded controller as far as
    that prediction's own band leaves it over; it scales with the predicted error.
    """
    low_m, high_m = prediction.band_m()
    if recorded is None:
        return low_m, high_m
    own_low_m, own_high_m = recorded.band_m()
    miss_m = np.abs(record.error_m - recorded.error_m)
    ninety_m = float(np.quantile(miss_m, 0.9))
    known_m = 0.5 * float(np.mean(own_high_m - own_low_m))
    left_m = float(np.sqrt(max(0.0, ninety_m**2 - known_m**2)))
    left_m *= _rms(prediction.error_m) / max(_rms(record.error_m), 1e-12)
    centre_m = prediction.error_m
    return (
        centre_m - np.hypot(centre_m - low_m, left_m),
        centre_m + np.hypot(high_m - centre_m, left_m),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _estimator_table(
    run: EstimatorRun, record: AxisRecord
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    unit = record.drive.unit
    units = dict(zip(_PARAMETERS, (f"{unit} s^2/m", f"{unit} s/m", unit), strict=True))
    columns: dict[str, NDArray[Any]] = {"stamp_ns": record.stamp_ns}
    for place, name in enumerate(_PARAMETERS):
        columns[name] = run.trace.parameters[:, place]
        columns[f"u_{name}"] = np.sqrt(run.trace.variances[:, place])
    columns["prediction_error"] = run.trace.prediction_error
    doubts = {f"u_{name}": value for name, value in units.items()}
    return columns, {"stamp_ns": "ns", "prediction_error": unit} | units | doubts
