"""Output error: the parameters with which the simulated axis does what the record did.

In closed loop the drive's law (see `servo`) and the axis follow the recorded reference and the
commands are compared; in open loop the axis moves under the recorded commands and the positions
are. Closed loop tells more and forgets its start, so it is taken where the law is known.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import optimize

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

from .filtering import FloatArray, decimate
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
from .regression import Fit, clustered_covariance, least_squares, not_below, require_apart
from .servo import Servo, fit_servo
from .simulation import AxisForces, axis_forces, simulate_commands, simulate_servo

Loop = Literal["auto", "closed", "open"]
HELD_PERIODS = 0.5
"""Lag that holding the command over a period makes by itself; a simulation has it already."""
_COARSE_TO_FINE = (3e-2, 1e-2, 1e-3)
"""Steps of the numerical Jacobian in open loop, where stick and slip make the error jagged."""
_KICKS = 8
"""Fresh starts near the best fit so far, for the same reason; the same ones each time."""


@dataclass(frozen=True)
class _Task:
    """What is fitted: `outputs` of parameters beside `wanted`, both per row of the fit."""

    loop: str
    names: tuple[str, ...]
    wanted: FloatArray
    outputs: Callable[[FloatArray], FloatArray]


def identify_output_error(
    record: AxisRecord,
    friction: Friction = "asymmetric-stribeck",
    settings: IdimSettings | None = None,
    loop: Loop = "auto",
) -> Identification:
    """Refine the values of IDIM-LS by simulation; as `identify_idim_ls` for what it needs."""
    settings = settings or IdimSettings()
    run = filtered_run(record, settings)
    motion = motion_of(run, settings)
    rows = idim_rows(run, friction, settings)
    start = least_squares(rows.names, rows.regressor, rows.measured, rows.block)
    servo, why = _servo(run.record, loop)
    task = _closed(run, rows, settings, servo) if servo else _open(run, rows, settings)
    fit = _refined(task, start, rows)
    axis = axis_forces(fit.names, fit.values.tolist(), FAST_STRIBECK_M_S)
    return Identification(
        method="output-error",
        friction=friction,
        fit=fit,
        rows=rows,
        motion=motion,
        unit=record.drive.result_unit,
        delay_periods=0,
        settings=settings_of(run, settings) | {"loop": task.loop},
        notes=(*run.notes, f"{task.loop} loop: {why}"),
        extras=simulation_details(run, axis, servo, settings),
    )


def simulation_details(
    run: FilteredRun, axis: AxisForces, servo: Servo | None, settings: IdimSettings
) -> dict[str, dict[str, float]]:
    """Relative errors in percent of a simulated loop, rms in mm of a simulated axis alone."""
    lag = simulated_lag(settings)
    record, scale = run.record, run.record.drive.scale
    alone_m = simulate_commands(record, axis, lag)
    rms_mm = 1e3 * float(np.sqrt(np.mean((alone_m - record.position_m) ** 2)))
    told: dict[str, dict[str, float]] = {"open_loop": {"position_rms_mm": rms_mm}}
    if servo is None:
        return told
    loop = simulate_servo(record, axis, servo, lag)
    kept = slice(settings.trim, None)
    told["closed_loop"] = {
        "position_error": _percent(loop.position_m, record.position_m),
        "velocity_error": _percent(loop.velocity_m_s[kept], run.velocity_m_s[kept]),
        "force_error": _percent(scale * loop.command, scale * record.command),
    }
    told["servo"] = {
        "position_gain_1_s": servo.position_gain_1_s,
        "velocity_gain": servo.velocity_gain,
        "window_periods": float(servo.window),
        "delay_periods": float(servo.delay_periods),
        "replay_error": 100 * servo.relative_error,
    }
    return told


def simulated_lag(settings: IdimSettings) -> float:
    """Lag of the force in a simulation that holds each command over its period, periods."""
    return min(max(settings.lag_periods - HELD_PERIODS, 0.0), 1.0)


def _percent(found: FloatArray, wanted: FloatArray) -> float:
    return 100 * float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


def _servo(record: AxisRecord, loop: Loop) -> tuple[Servo | None, str]:
    if loop == "open":
        return None, "asked for"
    try:
        servo = fit_servo(record)
    except EvidenceError as error:
        if loop == "closed":
            raise
        return None, str(error)
    gains = f"{servo.position_gain_1_s:.2f} 1/s, {servo.velocity_gain:.2f} {record.drive.unit} s/m"
    return servo, f"the record tells the drive's law ({gains})"


def _closed(run: FilteredRun, rows: Rows, settings: IdimSettings, servo: Servo) -> _Task:
    kept, lag, scale = slice(settings.trim, None), simulated_lag(settings), run.record.drive.scale

    def reduced(command: FloatArray) -> FloatArray:
        force = scale * decimate(command[kept], run.factor)
        return np.asarray(force[run.free_rows(settings)], dtype=np.float64)

    def outputs(values: FloatArray) -> FloatArray:
        axis = axis_forces(rows.names, values.tolist(), FAST_STRIBECK_M_S)
        return reduced(simulate_servo(run.record, axis, servo, lag).command)

    return _Task("closed", rows.names, reduced(run.record.command), outputs)


def _open(run: FilteredRun, rows: Rows, settings: IdimSettings) -> _Task:
    lag = simulated_lag(settings)

    def reduced(position: FloatArray) -> FloatArray:
        return position[:: run.factor]

    def outputs(values: FloatArray) -> FloatArray:
        axis = axis_forces(rows.names, values.tolist(), FAST_STRIBECK_M_S)
        return reduced(simulate_commands(run.record, axis, lag))

    return _Task("open", rows.names, reduced(run.record.position_m), outputs)


def _refined(task: _Task, start: Fit, rows: Rows) -> Fit:
    scale = np.maximum(np.abs(start.values), start.value("inertia") * 0.05)

    def missed(relative: FloatArray) -> FloatArray:
        return task.outputs(relative * scale) - task.wanted

    closed = task.loop == "closed"
    best = _descended(missed, start.values / scale, (1e-4,) if closed else _COARSE_TO_FINE)
    if not closed:
        best = _kicked(missed, best, start, scale)
    jacobian = np.asarray(best.jac / scale, dtype=np.float64)
    return _fit(task, rows, best.x * scale, jacobian, best.fun)


def _descended(
    missed: Callable[[FloatArray], FloatArray], start: FloatArray, steps: tuple[float, ...]
) -> optimize.OptimizeResult:
    for step in steps:
        each = np.full(len(start), step)
        found = optimize.least_squares(missed, start, diff_step=each, max_nfev=12)
        start = found.x
    return found


def _kicked(
    missed: Callable[[FloatArray], FloatArray],
    best: optimize.OptimizeResult,
    start: Fit,
    scale: FloatArray,
) -> optimize.OptimizeResult:
    """Basin hopping: kicks of 0.5 % of the inertia, 5 % of friction, 30 % near rest."""
    random = np.random.default_rng(0)
    size = np.array([_kick(name) for name in start.names]) * np.abs(best.x)
    size = np.maximum(size, 0.06 * start.value("inertia") * 0.05 / scale)
    for _ in range(_KICKS):
        found = _descended(missed, best.x + random.normal(0, size), _COARSE_TO_FINE[1:])
        best = found if found.cost < best.cost else best
    return best


def _kick(name: str) -> float:
    return 0.005 if name == "inertia" else 0.3 if name.startswith("stribeck") else 0.05


def _fit(
    task: _Task, rows: Rows, values: FloatArray, jacobian: FloatArray, missed: FloatArray
) -> Fit:
    """The fit at a minimum; `missed` is predicted - wanted there."""
    require_apart(task.names, jacobian)
    inverse = np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=np.float64)
    block = np.linspace(0, rows.block.max() + 1, len(missed), endpoint=False).astype(np.int64)
    white = inverse * float(np.var(missed, ddof=1))
    clustered = clustered_covariance(inverse, jacobian, -missed, block)
    return Fit(
        task.names,
        values,
        not_below(clustered, white),
        white,
        jacobian,
        task.wanted,
        task.wanted + missed,
    )


def with_lag(settings: IdimSettings, lag_periods: float) -> IdimSettings:
    """The same settings at another lag."""
    return replace(settings, lag_periods=lag_periods)
