"""IDIM-IV: instrumental variables from a simulated loop (Janot, Vandanjon and Gautier, 2014).

The regressor built from measured positions carries their noise; one built from a simulation of
the same loop along the same reference does not, yet moves with it. Its columns are the
instruments; simulation and estimate are repeated until they agree.
"""

from dataclasses import replace

import numpy as np

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

from .filtering import FloatArray, central_difference, smooth_zero_phase
from .friction_models import FAST_STRIBECK_M_S, Friction
from .idim_ls import (
    FilteredRun,
    IdimSettings,
    filtered_run,
    idim_rows,
    motion_of,
    settings_of,
)
from .method import Identification, Rows
from .output_error import simulated_lag, simulation_details
from .regression import Fit, least_squares
from .servo import Servo, fit_servo
from .simulation import AxisForces, axis_forces, simulate_servo

_ROUNDS = 6
_AGREED = 1e-4


def identify_idim_iv(
    record: AxisRecord, friction: Friction = "symmetric", settings: IdimSettings | None = None
) -> Identification:
    """Identify with simulated instruments; needs the reference and a drive's law that fits."""
    settings = settings or IdimSettings()
    run = filtered_run(record, settings)
    motion = motion_of(run, settings)
    servo = fit_servo(run.record)
    rows = idim_rows(run, friction, settings)
    fit, rounds = _agreed(run, rows, friction, settings, servo)
    return Identification(
        method="idim-iv",
        friction=friction,
        fit=fit,
        rows=rows,
        motion=motion,
        unit=record.drive.result_unit,
        delay_periods=0,
        settings=settings_of(run, settings) | {"rounds": rounds},
        notes=run.notes,
        extras=simulation_details(run, _axis(fit), servo, settings),
    )


def _agreed(
    run: FilteredRun, rows: Rows, friction: Friction, settings: IdimSettings, servo: Servo
) -> tuple[Fit, int]:
    fit = least_squares(rows.names, rows.regressor, rows.measured, rows.block)
    for count in range(1, _ROUNDS + 1):
        instruments = _instruments(run, _axis(fit), friction, settings, servo)
        before = fit.values
        fit = least_squares(rows.names, rows.regressor, rows.measured, rows.block, instruments)
        if np.all(np.abs(fit.values - before) <= _AGREED * np.abs(before)):
            return fit, count
    raise EvidenceError(
        f"idim-iv does not settle within {_ROUNDS} rounds: the simulated loop does not follow the "
        "recorded one; use --method idim-ls"
    )


def _instruments(
    run: FilteredRun, axis: AxisForces, friction: Friction, settings: IdimSettings, servo: Servo
) -> FloatArray:
    """The regressor of the simulated motion, filtered and decimated as the measured one."""
    loop = simulate_servo(run.record, axis, servo, simulated_lag(settings))
    period_s = run.record.period_s
    position = smooth_zero_phase(loop.position_m, 2 * run.cutoff_hz * period_s)
    velocity = central_difference(position, period_s)
    simulated = replace(
        run,
        position_m=position,
        velocity_m_s=velocity,
        acceleration_m_s2=central_difference(velocity, period_s),
    )
    return idim_rows(simulated, friction, settings).regressor


def _axis(fit: Fit) -> AxisForces:
    return axis_forces(fit.names, fit.values.tolist(), FAST_STRIBECK_M_S)
