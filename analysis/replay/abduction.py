"""Abduction: the disturbance and measurement residual with which the model reproduces a record.

Step by step the disturbance is chosen so that the model's next speed is the recorded one,
smoothed; what then remains between record and model is the measurement residual. With both, the
recorded controller in closed loop must give back the recorded commands, however wrong the model
is: that is the self-check of everything that a counterfactual replay is made of.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import signal

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.analysis.closed_loop import ClosedLoop, Reference, simulate
from seamlog.analysis.plant import Plant
from seamlog.contracts import Axis, Controller

from .model import replay_plant
from .shadow import applied_commands

_PULL_1_S = 0.5
"""How fast the model's position is drawn back to the recorded one."""
_HALVINGS = 24
"""More would not reproduce better: the measurement residual takes up what the load leaves."""


@dataclass(frozen=True)
class Abduction:
    """Disturbance in the command's unit and measurement residuals, each of shape (n,)."""

    disturbance: FloatArray
    position_residual_m: FloatArray
    velocity_residual_m_s: FloatArray
    position_m: FloatArray
    velocity_m_s: FloatArray


def abduce(record: AxisRecord, axis: Axis) -> Abduction:
    """Explain `record` with the plant of `axis`."""
    plant = replay_plant(axis, record.period_s)
    applied = applied_commands(record.command, axis.delay_periods).tolist()
    goal_m = record.position_m.tolist()
    goal_m_s = smooth_speed(record.velocity_m_s).tolist()
    count = len(record)
    position, velocity, load = goal_m[0], goal_m_s[0], 0.0
    rows: list[tuple[float, float, float]] = []
    for k in range(count):
        before = (position, velocity)
        if k + 1 < count:
            wanted = goal_m_s[k + 1] - _PULL_1_S * (position - goal_m[k])
            load = _disturbance(plant, before, applied[k], wanted, load)
        position, velocity = plant.step(*before, applied[k], load)
        rows.append((*before, load))
    model_m, model_m_s, loads = np.array(rows).T
    return Abduction(
        disturbance=loads,
        position_residual_m=record.position_m - model_m,
        velocity_residual_m_s=record.velocity_m_s - model_m_s,
        position_m=model_m,
        velocity_m_s=model_m_s,
    )


def smooth_speed(velocity_m_s: FloatArray) -> FloatArray:
    """Local quadratics over five samples."""
    return np.asarray(signal.savgol_filter(velocity_m_s, 5, 2), dtype=np.float64)


def reproduce(
    abduction: Abduction, record: AxisRecord, axis: Axis, controller: Controller
) -> ClosedLoop:
    """Run `controller` in closed loop with the abduced disturbance and residuals."""
    return simulate(
        controller,
        axis,
        reference_of(record),
        record.period_s,
        plant=replay_plant(axis, record.period_s),
        position_noise_m=abduction.position_residual_m,
        velocity_noise_m_s=abduction.velocity_residual_m_s,
        disturbance=abduction.disturbance,
        initial_position_m=float(abduction.position_m[0]),
        initial_velocity_m_s=float(abduction.velocity_m_s[0]),
    )


def reference_of(record: AxisRecord) -> Reference:
    """The motion that the record's controller was to follow."""
    return Reference(record.reference_m, record.reference_m_s, record.reference_m_s2)


def _disturbance(
    plant: Plant, motion: tuple[float, float], command: float, wanted_m_s: float, guess: float
) -> float:
    """The load after which the speed is `wanted_m_s`; the next speed never rises with the load."""

    def too_fast(load: float) -> bool:
        return plant.step(*motion, command, load)[1] > wanted_m_s

    low, high = _bracket(too_fast, guess)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if too_fast(middle):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _bracket(too_fast: Callable[[float], bool], guess: float) -> tuple[float, float]:
    """Loads below and above the one looked for, found by growing steps from `guess`."""
    reach = 1e-3 * max(1.0, abs(guess))
    low = high = guess
    while not too_fast(low):
        low -= reach
        reach *= 2.0
    while too_fast(high):
        high += reach
        reach *= 2.0
    return low, high
