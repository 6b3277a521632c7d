"""Shadow replay: recorded measurements into a controller or estimator, open loop.

Exact for estimators and for the recorded controller. For another controller it only says what
that one would have commanded at each recorded moment: with it in the loop those moments would not
have come, so it predicts no tracking error.
"""

from dataclasses import dataclass

import numpy as np

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.contracts import Controller, Estimator


@dataclass(frozen=True)
class ShadowOutput:
    """Command after saturation (n,) and the controller's states (n, count)."""

    command: FloatArray
    states: FloatArray


@dataclass(frozen=True)
class EstimatorTrace:
    """Parameters and variances after each sample, shape (n, 3) each, and prediction errors (n,)."""

    parameters: FloatArray
    variances: FloatArray
    prediction_error: FloatArray


def shadow_controller(
    controller: Controller, record: AxisRecord, saturation: float
) -> ShadowOutput:
    """Feed the record to `controller`."""
    rows = zip(
        record.reference_m.tolist(),
        record.reference_m_s.tolist(),
        record.reference_m_s2.tolist(),
        record.position_m.tolist(),
        record.velocity_m_s.tolist(),
        strict=True,
    )
    command, states = [], []
    for row in rows:
        command.append(min(max(controller.output(*row), -saturation), saturation))
        states.append(tuple(controller.state()))
    table = np.array(states, dtype=np.float64).reshape(len(command), -1)
    return ShadowOutput(np.array(command, dtype=np.float64), table)


def shadow_estimator(
    estimator: Estimator, record: AxisRecord, delay_periods: int
) -> EstimatorTrace:
    """Feed the record to `estimator`; the command acts `delay_periods` after it was sent."""
    applied = applied_commands(record.command, delay_periods).tolist()
    parameters, variances, errors = [], [], []
    for k, (position_m, velocity_m_s) in enumerate(
        zip(record.position_m.tolist(), record.velocity_m_s.tolist(), strict=True)
    ):
        before = applied[k - 1] if k else 0.0
        errors.append(estimator.update(position_m, velocity_m_s, before))
        parameters.append(estimator.parameters())
        variances.append(estimator.variances())
    return EstimatorTrace(np.array(parameters), np.array(variances), np.array(errors))


def applied_commands(command: FloatArray, delay_periods: int) -> FloatArray:
    """What acted over the period that follows each sample; 0 before the first command arrives."""
    return np.concatenate([np.zeros(delay_periods), command])[: len(command)]
