"""IDIM-LS: the inverse dynamic model of a fast record by least squares.

As Janot, Gautier and Brunot computed it for the EMPS axis (2019): position filtered with zero
phase, speed and acceleration by central differences, regressor and force decimated alike.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

from .excitation import require_both_directions
from .filtering import FloatArray, central_difference, decimate, decimated, smooth_zero_phase
from .friction_models import FAST_STRIBECK_M_S, Friction, friction_columns, names_of
from .method import Identification, Motion, Rows
from .regression import least_squares
from .usable import exclusions, require_evidence, usable_steps, without_repeats

MINIMUM_RATE_HZ = 200.0
BLOCK_S = 1.0
"""Rows of one second may err alike."""


@dataclass(frozen=True)
class IdimSettings:
    """Low pass and decimation; the defaults give the published ones at 1 kHz.

    cutoff_hz: of the position filter. decimated_hz: rate of the rows of the regression.
    trim: rows dropped at the start, where the filter has not settled. lag_periods: how much later
    than the command its force acts, in (fractions of) periods.
    """

    cutoff_hz: float = 100.0
    decimated_hz: float = 100.0
    trim: int = 49
    lag_periods: float = 0.0


@dataclass(frozen=True)
class FilteredRun:
    """The longest unbroken stretch of a record with its filtered motion; `whole` rows in all."""

    record: AxisRecord
    position_m: FloatArray
    velocity_m_s: FloatArray
    acceleration_m_s2: FloatArray
    cutoff_hz: float
    factor: int
    whole: int
    notes: tuple[str, ...]

    def force(self, lag_periods: float) -> FloatArray:
        """The force of the commands, that much later, shape (n,)."""
        force = self.record.command * self.record.drive.scale
        if lag_periods == 0.0:
            return np.asarray(force)
        count = np.arange(len(force), dtype=np.float64)
        return np.interp(count - lag_periods, count, force)

    def free_rows(self, settings: IdimSettings) -> NDArray[np.bool_]:
        """Decimated rows at least one decimation away from a saturated command."""
        near = np.convolve(self.record.saturated, np.ones(2 * self.factor + 1), mode="same") > 0.5
        return np.asarray(decimated(~near[settings.trim :], self.factor))


def identify_idim_ls(
    record: AxisRecord, friction: Friction = "symmetric", settings: IdimSettings | None = None
) -> Identification:
    """Identify from position and command at a high, even rate; no recorded speed is needed."""
    settings = settings or IdimSettings()
    run = filtered_run(record, settings)
    rows = idim_rows(run, friction, settings)
    return Identification(
        method="idim-ls",
        friction=friction,
        fit=least_squares(rows.names, rows.regressor, rows.measured, rows.block),
        rows=rows,
        motion=motion_of(run, settings),
        unit=record.drive.result_unit,
        delay_periods=0,
        settings=settings_of(run, settings),
        notes=run.notes,
    )


def filtered_run(record: AxisRecord, settings: IdimSettings) -> FilteredRun:
    """Filter the longest unbroken stretch; `EvidenceError` where it is too slow or too short."""
    rate_hz = 1 / record.period_s
    if rate_hz < MINIMUM_RATE_HZ:
        raise EvidenceError(
            f"idim-ls differentiates position twice and needs {MINIMUM_RATE_HZ:g} Hz, the record "
            f"has {rate_hz:.4g} Hz; use --method gated, which needs the logged velocity"
        )
    whole, repeats = without_repeats(record)
    require_evidence(whole)
    run = _longest_even_run(whole)
    factor = max(1, round(rate_hz / settings.decimated_hz))
    if len(run) - settings.trim < 50 * factor:
        raise EvidenceError(
            f"the longest stretch without a gap has {len(run)} samples, too few for a fit that "
            f"keeps one in {factor}; record for longer"
        )
    cutoff_hz = min(settings.cutoff_hz, 0.4 * rate_hz)
    position = smooth_zero_phase(run.position_m, 2 * cutoff_hz / rate_hz)
    velocity = central_difference(position, run.period_s)
    notes = exclusions(whole, repeats)
    if len(run) < len(whole):
        notes = (*notes, f"the longest unbroken stretch was used: {len(run)} of {len(whole)} rows")
    acceleration = central_difference(velocity, run.period_s)
    return FilteredRun(run, position, velocity, acceleration, cutoff_hz, factor, len(record), notes)


def idim_rows(run: FilteredRun, friction: Friction, settings: IdimSettings) -> Rows:
    """Regressor and force, decimated alike; rows with a saturated command left out."""
    kept = slice(settings.trim, None)
    friction_of = friction_columns(run.velocity_m_s, friction, FAST_STRIBECK_M_S)
    columns = np.column_stack([run.acceleration_m_s2, *friction_of])
    stamp_ns = decimated(run.record.stamp_ns[kept], run.factor)
    free = run.free_rows(settings)
    seconds = (stamp_ns - stamp_ns[0]) * 1e-9
    return Rows(
        names=names_of(friction, FAST_STRIBECK_M_S),
        regressor=decimate(columns[kept], run.factor)[free],
        measured=idim_force(run, settings),
        block=np.floor(seconds / BLOCK_S).astype(np.int64)[free],
        position_m=decimated(run.position_m[kept], run.factor)[free],
        velocity_m_s=decimated(run.velocity_m_s[kept], run.factor)[free],
        stamp_ns=stamp_ns[free],
    )


def idim_force(run: FilteredRun, settings: IdimSettings) -> FloatArray:
    """The force alone, on the rows of `idim_rows`."""
    kept = slice(settings.trim, None)
    free = run.free_rows(settings)
    return decimate(run.force(settings.lag_periods)[kept], run.factor)[free]


def motion_of(run: FilteredRun, settings: IdimSettings) -> Motion:
    """What the fit rests on; refuses motion in one direction only."""
    kept = slice(settings.trim, None)
    share = (len(run.record) - settings.trim) / run.whole
    motion = Motion(run.velocity_m_s[kept], run.acceleration_m_s2[kept], share)
    require_both_directions(motion)
    return motion


def settings_of(run: FilteredRun, settings: IdimSettings) -> dict[str, float | int | str]:
    """As used, JSON-ready."""
    return {
        "cutoff_hz": run.cutoff_hz,
        "decimation": run.factor,
        "trim": settings.trim,
        "lag_periods": settings.lag_periods,
    }


def _longest_even_run(record: AxisRecord) -> AxisRecord:
    """Longest stretch with finite values and steps within half a period of the period."""
    breaks = np.flatnonzero(~usable_steps(record))
    starts = np.concatenate([[0], breaks + 1])
    ends = np.concatenate([breaks + 1, [len(record)]])
    longest = int(np.argmax(ends - starts))
    return record.rows(slice(int(starts[longest]), int(ends[longest])))
