"""The exact gated sampled form, for slow loops: no differentiation, no smoothing of friction.

Over one control period with a held command u and one sign s of the speed the axis obeys
`a dv + b dx + C s T + offset T = u T` exactly. Rows where the speed changes sign, comes near zero
or a message is missing are zeroed as a whole, which keeps each other row exact; then all columns
pass the same filter 1/(1 - q z^-1), so that noise of the speed is weighed less.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

from .excitation import require_both_directions
from .filtering import FloatArray
from .method import Friction, Identification, Motion, friction_columns, names_of
from .regression import Fit, correlated_least_squares

USUAL_DELAY = 1
"""Periods between a command and its effect in a sampled loop that computes while it waits."""


@dataclass(frozen=True)
class GatedSettings:
    """gate_m_s: slowest speed that counts as sliding. filter_rate_1_s: rate of the filter's pole.

    settle: rows dropped at the start, while the filter fills.
    """

    gate_m_s: float = 0.005
    filter_rate_1_s: float = 0.75
    settle: int = 50


@dataclass(frozen=True)
class _Windows:
    """One row per control period: change of speed and place, mean speed, which rows count."""

    speed_change_m_s: FloatArray
    travel_m: FloatArray
    velocity_m_s: FloatArray
    duration_s: FloatArray
    sliding: NDArray[np.bool_]


def identify_gated(
    record: AxisRecord,
    friction: Friction = "symmetric",
    delay_periods: int = USUAL_DELAY,
    settings: GatedSettings | None = None,
) -> Identification:
    """Identify from logged position, speed and command.

    The delay between a command and its effect must be known: residuals of a disturbed axis hardly
    tell one period from the next.
    """
    settings = settings or GatedSettings()
    if not record.has_velocity:
        raise EvidenceError(
            "the record has no velocity, and differences of a position sampled at "
            f"{1 / record.period_s:.4g} Hz would bias the inertia; log velocity_m_s, or record "
            "at 200 Hz or faster and use --method idim-ls"
        )
    windows = _windows(record, settings.gate_m_s)
    motion = _motion(windows)
    if int(windows.sliding.sum()) < 2 * settings.settle:
        raise EvidenceError(
            f"only {int(windows.sliding.sum())} control periods show motion faster than "
            f"{1e3 * settings.gate_m_s:g} mm/s, {2 * settings.settle} are needed; "
            "record a run that moves to and fro, such as 100 sin(t) mm for 20 s"
        )
    require_both_directions(motion)
    return Identification(
        method="gated",
        friction=friction,
        fit=_fit(record, windows, friction, delay_periods, settings),
        motion=motion,
        stamp_ns=record.stamp_ns[1 + settings.settle :],
        unit=record.drive.result_unit,
        delay_periods=delay_periods,
        settings={"gate_m_s": settings.gate_m_s, "filter_rate_1_s": settings.filter_rate_1_s},
    )


def _windows(record: AxisRecord, gate_m_s: float) -> _Windows:
    speed = record.velocity_m_s
    duration_s = np.diff(record.stamp_ns) * 1e-9
    even = np.abs(duration_s - record.period_s) <= 0.5 * record.period_s
    with np.errstate(invalid="ignore"):
        same_sign = speed[1:] * speed[:-1] > 0
        fast = np.minimum(np.abs(speed[1:]), np.abs(speed[:-1])) > gate_m_s
    travel = np.diff(record.position_m)
    finite = np.isfinite(travel) & np.isfinite(record.command[:-1])
    return _Windows(
        np.diff(speed),
        travel,
        travel / record.period_s,
        duration_s,
        even & same_sign & fast & finite,
    )


def _fit(
    record: AxisRecord, windows: _Windows, friction: Friction, delay: int, settings: GatedSettings
) -> Fit:
    applied = np.full(len(record) - 1, np.nan)
    applied[delay:] = (record.command * record.drive.scale)[: len(record) - 1 - delay]
    used = windows.sliding & np.isfinite(applied)
    velocity = np.where(used, windows.velocity_m_s, 0.0)
    period_s = record.period_s
    columns = [windows.speed_change_m_s / period_s, *friction_columns(velocity, friction), applied]
    rows = np.where(used[:, None], np.column_stack(columns), 0.0)
    pole = 1 - settings.filter_rate_1_s * period_s
    weighed = signal.lfilter([1 - pole], [1, -pole], rows, axis=0)[settings.settle :]
    memory = int(np.ceil(2 / (1 - pole)))
    return correlated_least_squares(names_of(friction), weighed[:, :-1], weighed[:, -1], memory)


def _motion(windows: _Windows) -> Motion:
    used = windows.sliding
    acceleration = windows.speed_change_m_s[used] / windows.duration_s[used]
    return Motion(windows.velocity_m_s[used], acceleration, float(used.mean()))
