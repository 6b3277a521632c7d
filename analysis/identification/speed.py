"""The speed of a record that has none: smoothed from its positions."""

from dataclasses import replace

import numpy as np

from seamlog.analysis.axis_record import AxisRecord
from seamlog.analysis.velocity.kalman import encoder_noise_m, likeliest_model, smoothed_velocity
from seamlog.errors import EvidenceError

COARSEST_STEP_M = 2e-5
"""Encoder step above which the speed of a slow loop is too uncertain for an inertia."""


def with_velocity(record: AxisRecord) -> tuple[AxisRecord, tuple[str, ...]]:
    """The record with velocity, and a sentence if it had to be made from the position."""
    if record.has_velocity:
        return record, ()
    noise_m = encoder_noise_m(record.position_m)
    if noise_m * np.sqrt(12.0) > COARSEST_STEP_M:
        raise EvidenceError(
            f"the record has no velocity, and a position in steps of {1e3 * noise_m * 12**0.5:.3g} "
            f"mm sampled at {1 / record.period_s:.4g} Hz would bias the inertia; log velocity_m_s, "
            "or record at 200 Hz or faster and use --method idim-ls"
        )
    model = likeliest_model(record.position_m, record.period_s, noise_m)
    told = "the record has no velocity: it was smoothed from the positions"
    return replace(record, velocity_m_s=smoothed_velocity(record.position_m, model)), (told,)
