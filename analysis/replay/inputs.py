"""What a replay is fed: the control loop's record on an even grid, nothing missing.

Rows that the recorder did not get are filled by interpolation (commands are held), speeds that
were not recorded are derived; each such help is told in `notes`. Where nothing is missing, the
columns are the recorded ones, bit for bit.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.errors import EvidenceError

MOST_FILLED = 0.05
"""Largest share of rows that may be filled."""
LONGEST_HOLE_S = 2.0
"""Longest hole that may be filled."""


@dataclass(frozen=True)
class ReplayInputs:
    """A complete record, and what was done to complete it."""

    record: AxisRecord
    notes: tuple[str, ...]
    filled: NDArray[np.bool_]
    """Rows that were made up, shape (n,)."""


def replay_inputs(record: AxisRecord) -> ReplayInputs:
    """Complete `record`; `EvidenceError` where too much of it is missing."""
    notes: list[str] = []
    if not record.has_reference:
        raise EvidenceError(
            "the session has no /table/reference: a controller cannot be replayed without what it "
            "was to follow; record or import the reference"
        )
    record = _without_ends(record)
    repeats = int(np.sum(np.diff(record.stamp_ns) <= 0))
    if repeats:
        notes.append(f"{repeats} rows whose stamp repeats or goes back were left out")
    record, filled = _filled(record)
    _require_small_holes(record, filled)
    if filled.any():
        notes.append(
            f"{int(filled.sum())} missing control periods were filled by interpolation; no figure "
            "is judged over them"
        )
    period_s = record.period_s
    if not record.has_velocity:
        record = replace(record, velocity_m_s=_backward(record.position_m, period_s))
        notes.append("velocity was not recorded: backward differences of position stand for it")
    if not np.isfinite(record.reference_m_s).any():
        record = replace(record, reference_m_s=np.gradient(record.reference_m, period_s))
        notes.append("reference velocity was not recorded: derived from the reference position")
    if not np.isfinite(record.reference_m_s2).any():
        record = replace(record, reference_m_s2=np.gradient(record.reference_m_s, period_s))
        notes.append("reference acceleration was not recorded: derived from the reference")
    return ReplayInputs(record, tuple(notes), filled)


def _require_small_holes(record: AxisRecord, filled: NDArray[np.bool_]) -> None:
    count = int(filled.sum())
    if count > MOST_FILLED * len(record):
        raise EvidenceError(
            f"{count} of {len(record)} control periods are missing in the session, more than "
            f"{100 * MOST_FILLED:.0f} %: a replay over them would be invented"
        )
    edges = np.flatnonzero(np.diff(np.concatenate([[0], filled.astype(np.int8), [0]])))
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        hole_s = (end - start) * record.period_s
        if hole_s > LONGEST_HOLE_S:
            raise EvidenceError(
                f"a hole of {hole_s:.3g} s at log time {record.log_time_ns[start]} ns is longer "
                f"than {LONGEST_HOLE_S:g} s: a replay over it would be invented"
            )


def _without_ends(record: AxisRecord) -> AxisRecord:
    """Drop rows before the first and after the last complete one."""
    whole = np.isfinite(record.position_m) & np.isfinite(record.reference_m)
    whole &= np.isfinite(record.command)
    rows = np.flatnonzero(whole)
    if len(rows) < 10:
        raise EvidenceError(
            f"only {len(rows)} control periods have position, reference and command; "
            "ten are needed for a replay"
        )
    return record.rows(slice(int(rows[0]), int(rows[-1]) + 1))


def _filled(record: AxisRecord) -> tuple[AxisRecord, NDArray[np.bool_]]:
    """Columns with finite values on an even grid, and which rows had to be made up."""
    period_ns = record.period_s * 1e9
    step = np.rint(np.diff(record.stamp_ns) / period_ns).astype(np.int64)
    place = np.concatenate([[0], np.cumsum(np.maximum(step, 0))])
    first = np.concatenate([[True], step > 0])
    count = int(place[-1]) + 1
    grid = np.arange(count)
    gaps = count - int(first.sum())
    columns: dict[str, Any] = {}
    missing = np.ones(count, dtype=np.bool_)
    missing[place[first]] = False
    for item in fields(record):
        column = getattr(record, item.name)
        if isinstance(column, np.ndarray):
            hold = item.name in ("command", "saturated")
            columns[item.name], bad = _column(column[first], place[first], grid, hold)
            missing |= bad
    if not missing.any() and gaps == 0 and first.all():
        return record, missing
    return replace(record, **columns), missing


def _column(
    values: NDArray[Any], place: NDArray[np.int64], grid: NDArray[np.int64], hold: bool
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    none = np.zeros(len(grid), dtype=np.bool_)
    if values.dtype.kind == "f":
        finite = np.isfinite(values)
        if not finite.any():
            return np.full(len(grid), np.nan), none
        bad = none.copy()
        bad[place[~finite]] = True
        values, place = values[finite], place[finite]
    else:
        bad = none
    if hold or values.dtype.kind == "b":
        return values[np.maximum(np.searchsorted(place, grid, side="right") - 1, 0)], bad
    if values.dtype.kind == "i":
        start = values[0]
        since = np.interp(grid, place, (values - start).astype(np.float64))
        return start + np.rint(since).astype(np.int64), bad
    return np.interp(grid, place, values), bad


def _backward(values: FloatArray, period_s: float) -> FloatArray:
    return np.concatenate([[0.0], np.diff(values) / period_s])
