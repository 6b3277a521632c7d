"""The exact gated sampled form, for slow loops: no differentiation, no smoothing of friction.

Over one control period with a held command u and one sign s of the speed the axis obeys
`a dv + b dx + C s T + offset T = u T` exactly. Stretches in which it slides (no change of sign, no
speed near zero, no message missing, no saturation) are taken apart. In each all columns pass the
filter 1/(1 - q z^-1), so that the noise of the differenced speed becomes white again but for the
fading share of the stretch's first speed, which is projected out.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

from .excitation import require_both_directions
from .friction_models import SLOW_STRIBECK_M_S, FloatArray, Friction, friction_columns, names_of
from .method import Identification, Motion, Rows
from .regression import Fit, least_squares
from .ripple import RIPPLE_NAMES, Pitch, likeliest_pitch, ripple_columns, searched_pitches_m
from .speed import with_velocity
from .usable import exclusions, require_evidence, unsaturated, without_repeats

USUAL_DELAY = 1
"""Periods between a command and its effect in a sampled loop that computes while it waits."""
_LEAST_WINDOWS = 100
_LEAST_STRETCH = 8


@dataclass(frozen=True)
class GatedSettings:
    """gate_m_s: slowest speed that counts as sliding. filter_rate_1_s: rate of the filter's pole.

    A rate at or above that of the sampling leaves the rows unfiltered (`batch`).
    """

    gate_m_s: float = 0.005
    filter_rate_1_s: float = 0.75


@dataclass(frozen=True)
class _Windows:
    """One row per control period; `stretch` is -1 where the axis does not slide."""

    speed_change_m_s: FloatArray
    start_m: FloatArray
    end_m: FloatArray
    velocity_m_s: FloatArray
    applied: FloatArray
    stamp_ns: NDArray[np.int64]
    stretch: NDArray[np.int64]
    period_s: float

    @property
    def sliding(self) -> NDArray[np.bool_]:
        """Which rows count."""
        return np.asarray(self.stretch >= 0)


def identify_gated(
    record: AxisRecord,
    friction: Friction = "symmetric",
    delay_periods: int = USUAL_DELAY,
    settings: GatedSettings | None = None,
    method: str = "gated",
) -> Identification:
    """Identify from logged position, speed and command.

    The delay between a command and its effect must be known: residuals of a disturbed axis hardly
    tell one period from the next. Ripple of the screw is part of the model where it shows.
    """
    settings = settings or GatedSettings()
    whole, repeats = without_repeats(record)
    require_evidence(whole)
    record, notes = with_velocity(whole)
    windows = _windows(unsaturated(record), delay_periods, settings.gate_m_s)
    _require_motion(windows, settings.gate_m_s)
    motion = _motion(windows)
    require_both_directions(motion)
    rows = _rows(windows, friction, settings)
    fit, pitch = _fit_with_ripple(windows, rows, settings)
    extras = {"ripple": _ripple_details(fit, pitch)} if pitch else {}
    if pitch:
        notes = (
            *notes,
            f"ripple of the screw with a pitch of {1e3 * pitch.pitch_m:.3g} mm shows "
            "and is part of the model",
        )
    return Identification(
        method=method,
        friction=friction,
        fit=_widened(
            _first(fit, len(rows.names)), record, friction, delay_periods, settings, pitch
        ),
        rows=rows,
        motion=motion,
        unit=record.drive.result_unit,
        delay_periods=delay_periods,
        settings={"gate_m_s": settings.gate_m_s, "filter_rate_1_s": settings.filter_rate_1_s},
        notes=(*exclusions(whole, repeats), *notes),
        extras=extras,
    )


def gated_rows(
    record: AxisRecord,
    friction: Friction,
    delay_periods: int,
    settings: GatedSettings | None = None,
) -> Rows:
    """The rows alone, for model selection; `EvidenceError` without enough motion."""
    settings = settings or GatedSettings()
    record, _ = with_velocity(without_repeats(record)[0])
    windows = _windows(unsaturated(record), delay_periods, settings.gate_m_s)
    _require_motion(windows, settings.gate_m_s)
    return _rows(windows, friction, settings)


def _require_motion(windows: _Windows, gate_m_s: float) -> None:
    count = int(windows.sliding.sum())
    if count < _LEAST_WINDOWS:
        raise EvidenceError(
            f"only {count} control periods show motion faster than {1e3 * gate_m_s:g} mm/s, "
            f"{_LEAST_WINDOWS} are needed; record a run that moves to and fro, such as "
            "100 sin(t) mm for 20 s"
        )


def _windows(record: AxisRecord, delay_periods: int, gate_m_s: float) -> _Windows:
    speed = record.velocity_m_s
    count = len(record) - 1
    applied = np.full(count, np.nan)
    applied[delay_periods:] = (record.command * record.drive.scale)[: count - delay_periods]
    with np.errstate(invalid="ignore"):
        same_sign = speed[1:] * speed[:-1] > 0
        fast = np.minimum(np.abs(speed[1:]), np.abs(speed[:-1])) > gate_m_s
    travel = np.diff(record.position_m)
    sliding = _unbroken(record, delay_periods) & same_sign & fast & np.isfinite(applied + travel)
    return _Windows(
        speed_change_m_s=np.diff(speed),
        start_m=record.position_m[:-1],
        end_m=record.position_m[1:],
        velocity_m_s=travel / record.period_s,
        applied=applied,
        stamp_ns=record.stamp_ns[1:],
        stretch=_stretches(sliding),
        period_s=record.period_s,
    )


def _unbroken(record: AxisRecord, delay_periods: int) -> NDArray[np.bool_]:
    """Rows whose own step is ordinary and, because of the delay, those of the periods before."""
    steps_s = np.diff(record.stamp_ns) * 1e-9
    even = np.abs(steps_s - record.period_s) <= 0.5 * record.period_s
    unbroken = even.copy()
    for back in range(1, delay_periods + 1):
        unbroken[back:] &= even[:-back]
    return np.asarray(unbroken & np.isfinite(np.diff(record.position_m)))


def _stretches(sliding: NDArray[np.bool_]) -> NDArray[np.int64]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], sliding.astype(np.int8), [0]])))
    stretch = np.full(len(sliding), -1, dtype=np.int64)
    for number, (start, end) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        if end - start >= _LEAST_STRETCH:
            stretch[start:end] = number
    return stretch


def _rows(windows: _Windows, friction: Friction, settings: GatedSettings) -> Rows:
    used = windows.sliding
    acceleration = windows.speed_change_m_s / windows.period_s
    velocity = np.where(used, windows.velocity_m_s, 0.0)
    columns = [acceleration, *friction_columns(velocity, friction, SLOW_STRIBECK_M_S)]
    filtered = _filtered(windows, np.column_stack([*columns, windows.applied]), settings)
    return Rows(
        names=names_of(friction, SLOW_STRIBECK_M_S),
        regressor=filtered[:, :-1],
        measured=filtered[:, -1],
        block=windows.stretch[used],
        position_m=windows.end_m[used],
        velocity_m_s=windows.velocity_m_s[used],
        stamp_ns=windows.stamp_ns[used],
    )


def _filtered(windows: _Windows, columns: FloatArray, settings: GatedSettings) -> FloatArray:
    """Columns of each stretch filtered and freed from what the first speed's noise adds."""
    pole = max(0.0, 1 - settings.filter_rate_1_s * windows.period_s)
    parts = []
    labels = windows.stretch
    for number in np.unique(labels[labels >= 0]):
        rows = columns[labels == number]
        if pole > 0.0:
            rows = signal.lfilter([1 - pole], [1, -pole], rows, axis=0)
            fading = pole ** np.arange(1.0, len(rows) + 1)
            rows = rows - np.outer(fading, fading @ rows) / (fading @ fading)
        parts.append(rows)
    return np.vstack(parts)


def _fit_with_ripple(
    windows: _Windows, rows: Rows, settings: GatedSettings
) -> tuple[Fit, Pitch | None]:
    fit = least_squares(rows.names, rows.regressor, rows.measured, rows.block)
    ripples = [_ripple(windows, pitch_m, settings) for pitch_m in searched_pitches_m()]
    pitch = likeliest_pitch(fit.residual, rows.regressor, ripples)
    if pitch is None:
        return fit, None
    more = np.hstack([rows.regressor, _ripple(windows, pitch.pitch_m, settings)])
    return least_squares((*rows.names, *RIPPLE_NAMES), more, rows.measured, rows.block), pitch


def _ripple(windows: _Windows, pitch_m: float, settings: GatedSettings) -> FloatArray:
    columns = ripple_columns(windows.start_m, windows.end_m, pitch_m)
    return _filtered(windows, np.column_stack(columns), settings)


def _first(fit: Fit, count: int) -> Fit:
    """The fit without what follows the first `count` parameters, their doubt kept."""
    return Fit(
        fit.names[:count],
        fit.values[:count],
        fit.covariance[:count, :count],
        fit.white_covariance[:count, :count],
        fit.regressor[:, :count],
        fit.measured,
        fit.predicted,
    )


def _widened(
    fit: Fit,
    record: AxisRecord,
    friction: Friction,
    delay_periods: int,
    settings: GatedSettings,
    pitch: Pitch | None,
) -> Fit:
    """The fit with what its values move by when twice the gate is asked: friction near rest.

    The squared shift joins the variances; a record that is too slow for twice the gate keeps them.
    """
    stricter = replace(settings, gate_m_s=2 * settings.gate_m_s)
    windows = _windows(unsaturated(record), delay_periods, stricter.gate_m_s)
    if int(windows.sliding.sum()) < _LEAST_WINDOWS:
        return fit
    rows = _rows(windows, friction, stricter)
    columns = rows.regressor
    if pitch:
        columns = np.hstack([columns, _ripple(windows, pitch.pitch_m, stricter)])
    values = np.linalg.lstsq(columns, rows.measured, rcond=None)[0][: len(fit.values)]
    return replace(fit, covariance=fit.covariance + np.diag((values - fit.values) ** 2))


def _ripple_details(fit: Fit, pitch: Pitch) -> dict[str, float]:
    sine, cosine = fit.values[-2:].tolist()
    return {
        "pitch_m": pitch.pitch_m,
        "sine": sine,
        "cosine": cosine,
        "amplitude": float(np.hypot(sine, cosine)),
    }


def _motion(windows: _Windows) -> Motion:
    used = windows.sliding
    acceleration = windows.speed_change_m_s[used] / windows.period_s
    return Motion(windows.velocity_m_s[used], acceleration, float(used.mean()))
