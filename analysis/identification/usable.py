"""Which rows of a record may enter an identification, and what is said about the others."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord
from seamlog.errors import EvidenceError

MOST_SATURATED = 0.5


def require_evidence(record: AxisRecord) -> None:
    """`EvidenceError` for a record whose commands say nothing."""
    finite = record.command[np.isfinite(record.command)]
    if len(finite) < 3:
        raise EvidenceError(
            f"{len(record)} control periods, {len(finite)} with a command: "
            "nothing can be identified; log /table/command in each period"
        )
    if float(np.ptp(finite)) == 0.0:
        raise EvidenceError(
            f"the command is {finite[0]:g} throughout: inertia and friction cannot be told from "
            "a constant command; record a run that moves to and fro"
        )
    share = float(record.saturated.mean())
    if share > MOST_SATURATED:
        raise EvidenceError(
            f"the command was saturated in {100 * share:.0f} % of the control periods: what is "
            "left tells too little; record a run within the limits of the drive"
        )


def without_repeats(record: AxisRecord) -> tuple[AxisRecord, int]:
    """The record without rows whose stamp does not rise, and how many there were."""
    newest = np.maximum.accumulate(record.stamp_ns)
    rises = np.ones(len(record), dtype=np.bool_)
    rises[1:] = record.stamp_ns[1:] > newest[:-1]
    repeats = int((~rises).sum())
    return (record.rows(rises), repeats) if repeats else (record, 0)


def usable_steps(record: AxisRecord) -> NDArray[np.bool_]:
    """For each pair of neighbours: an ordinary step, both ends finite; shape (n - 1,)."""
    steps_s = np.diff(record.stamp_ns) * 1e-9
    even = np.abs(steps_s - record.period_s) <= 0.5 * record.period_s
    finite = np.isfinite(record.position_m) & np.isfinite(record.command)
    return np.asarray(even & finite[1:] & finite[:-1])


def exclusions(record: AxisRecord, repeats: int) -> tuple[str, ...]:
    """Sentences for people on gaps, repeats, missing values and saturation."""
    steps_s = np.diff(record.stamp_ns) * 1e-9
    gaps = steps_s[np.abs(steps_s - record.period_s) > 0.5 * record.period_s]
    missing = int((~(np.isfinite(record.position_m) & np.isfinite(record.command))).sum())
    saturated = int(record.saturated.sum())
    told = []
    if len(gaps):
        told.append(f"{len(gaps)} uneven steps of up to {gaps.max():.3g} s were left out")
    if repeats:
        told.append(f"{repeats} messages whose stamp did not rise were left out")
    if missing:
        told.append(f"{missing} control periods without position or command were left out")
    if saturated:
        told.append(f"{saturated} control periods with a saturated command were left out")
    return tuple(told)


def unsaturated(record: AxisRecord) -> AxisRecord:
    """The record with the commands of saturated periods unknown (NaN)."""
    if not record.saturated.any():
        return record
    return replace(record, command=np.where(record.saturated, np.nan, record.command))
