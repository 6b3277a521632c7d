"""IDIM-LS: the inverse dynamic model of a fast record by least squares.

As Janot, Gautier and Brunot computed it for the EMPS axis (2019): position filtered with zero
phase, speed and acceleration by central differences, regressor and force decimated alike.
"""

from dataclasses import dataclass

import numpy as np

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

from .excitation import require_both_directions
from .filtering import FloatArray, central_difference, decimate, decimated, smooth_zero_phase
from .method import Friction, Identification, Motion, friction_columns, names_of
from .regression import least_squares

MINIMUM_RATE_HZ = 200.0


@dataclass(frozen=True)
class IdimSettings:
    """Low pass and decimation; the defaults give the published ones at 1 kHz.

    cutoff_hz: of the position filter. decimated_hz: rate of the rows of the regression.
    trim: rows dropped at the start, where the filter has not settled.
    """

    cutoff_hz: float = 100.0
    decimated_hz: float = 100.0
    trim: int = 49


def identify_idim_ls(
    record: AxisRecord, friction: Friction = "symmetric", settings: IdimSettings | None = None
) -> Identification:
    """Identify from position and command at a high, even rate; no recorded speed is needed."""
    settings = settings or IdimSettings()
    rate_hz = 1 / record.period_s
    if rate_hz < MINIMUM_RATE_HZ:
        raise EvidenceError(
            f"idim-ls differentiates position twice and needs {MINIMUM_RATE_HZ:g} Hz, the record "
            f"has {rate_hz:.4g} Hz; use --method gated, which needs the logged velocity"
        )
    whole = len(record)
    record = _longest_even_run(record)
    cutoff_hz = min(settings.cutoff_hz, 0.4 * rate_hz)
    factor = max(1, round(rate_hz / settings.decimated_hz))
    velocity, acceleration = _derivatives(record, 2 * cutoff_hz / rate_hz)
    kept = slice(settings.trim, None)
    if len(record) - settings.trim < 50 * factor:
        raise EvidenceError(
            f"the longest stretch without a gap has {len(record)} samples, too few for a fit that "
            f"keeps one in {factor}; record for longer"
        )
    motion = Motion(velocity[kept], acceleration[kept], (len(record) - settings.trim) / whole)
    require_both_directions(motion)
    columns = [acceleration, *friction_columns(velocity, friction)]
    regressor = decimate(np.column_stack(columns)[kept], factor)
    force = decimate((record.command * record.drive.scale)[kept], factor)
    return Identification(
        method="idim-ls",
        friction=friction,
        fit=least_squares(names_of(friction), regressor, force),
        motion=motion,
        stamp_ns=decimated(record.stamp_ns[kept], factor),
        unit=record.drive.result_unit,
        delay_periods=0,
        settings={"cutoff_hz": cutoff_hz, "decimation": factor, "trim": settings.trim},
    )


def _derivatives(record: AxisRecord, cutoff: float) -> tuple[FloatArray, FloatArray]:
    position = smooth_zero_phase(record.position_m, cutoff)
    velocity = central_difference(position, record.period_s)
    return velocity, central_difference(velocity, record.period_s)


def _longest_even_run(record: AxisRecord) -> AxisRecord:
    """Longest stretch with finite values and steps within half a period of the period."""
    steps_s = np.diff(record.stamp_ns) * 1e-9
    even = np.abs(steps_s - record.period_s) <= 0.5 * record.period_s
    finite = np.isfinite(record.position_m) & np.isfinite(record.command)
    joined = even & finite[1:] & finite[:-1]
    breaks = np.flatnonzero(~joined)
    starts = np.concatenate([[0], breaks + 1])
    ends = np.concatenate([breaks + 1, [len(record)]])
    longest = int(np.argmax(ends - starts))
    return record.rows(slice(int(starts[longest]), int(ends[longest])))
