"""An identified model against another record of the same axis: what it was not fitted to."""

from dataclasses import dataclass

import numpy as np

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

from .friction_models import FAST_STRIBECK_M_S
from .gated import GatedSettings, gated_rows
from .idim_ls import MINIMUM_RATE_HZ, IdimSettings, filtered_run, idim_rows
from .method import Identification, Rows
from .output_error import simulation_details
from .servo import Servo, fit_servo
from .simulation import axis_forces


@dataclass(frozen=True)
class Validation:
    """Relative force error in percent, and the errors of simulation for fast records."""

    force_error: float
    simulation: dict[str, dict[str, float]]


def validate(found: Identification, record: AxisRecord) -> Validation:
    """Predict `record` with the parameters of `found`, none of them fitted again.

    Raises `EvidenceError` if the two records are not of one kind (rate, unit).
    """
    fast = 1 / record.period_s >= MINIMUM_RATE_HZ
    if fast != (found.method not in ("gated", "batch")):
        raise EvidenceError(
            f"a model of method {found.method} cannot be judged on a record at "
            f"{1 / record.period_s:.4g} Hz; record both at rates on one side of "
            f"{MINIMUM_RATE_HZ:g} Hz"
        )
    if record.drive.result_unit != found.unit:
        raise EvidenceError(
            f"the model is in {found.unit}, the other record in {record.drive.result_unit}: "
            "give both the same force_per_unit"
        )
    if not fast:
        settings = GatedSettings(
            float(found.settings["gate_m_s"]), float(found.settings["filter_rate_1_s"])
        )
        rows = gated_rows(record, found.friction, found.delay_periods, settings)
        return Validation(_force_error(found, rows), {})
    fine = IdimSettings(lag_periods=float(found.settings["lag_periods"]))
    run = filtered_run(record, fine)
    names, values = found.fit.names, found.fit.values.tolist()
    axis = axis_forces(names, values, FAST_STRIBECK_M_S)
    simulation = simulation_details(run, axis, _servo(run.record), fine)
    return Validation(_force_error(found, idim_rows(run, found.friction, fine)), simulation)


def _force_error(found: Identification, rows: Rows) -> float:
    missed = rows.measured - rows.regressor @ found.fit.values
    return 100 * float(np.linalg.norm(missed) / np.linalg.norm(rows.measured))


def _servo(record: AxisRecord) -> Servo | None:
    try:
        return fit_servo(record)
    except EvidenceError:
        return None
