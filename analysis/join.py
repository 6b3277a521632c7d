"""The join: each station of the bead tied to the moment at which the torch was there.

The bead's start and stop on the photo are tied to arc on and arc off; which end is the start
somebody has to say. Without that, or where the tie is worse than 5 mm, nothing is joined.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ChannelMissing, EvidenceError

from .axis_record import load_axis_record
from .bead.measurement import BeadMeasurement
from .torch_path import TorchPath, torch_path

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld

Floats = NDArray[np.float64]

WORST_U_S_MM = 5.0
EFFICIENCY = 0.8
"""Thermal efficiency of MAG welding, EN 1011-1."""
PROCESS = "/weld/process"
_BOTH = "start and stop of the bead tied to arc on and arc off"
_START = "start of the bead tied to arc on"


@dataclass(frozen=True, slots=True)
class Tie:
    """How the photo's arc length becomes that of the torch: s_torch = s_photo - offset_mm."""

    offset_mm: float
    u_s_mm: float
    method: str


@dataclass(frozen=True, slots=True)
class Joined:
    """Columns per station, in the order of the weld; what was not logged is NaN."""

    columns: dict[str, NDArray[Any]]
    tie: Tie


def tie_bead(bead: BeadMeasurement, torch: TorchPath) -> Tie:
    """Tie the bead's ends to the torch's path; `EvidenceError` says why it cannot be done."""
    if bead.unit != "mm":
        raise EvidenceError("the photo has no calibration, so its pixels have no place in mm")
    if not bead.direction_known:
        raise EvidenceError("the direction is ambiguous; say with --start where the weld began")
    if bead.open_start:
        raise EvidenceError("the start of the bead is not in the photo, so nothing ties it to time")
    width = float(np.nanmedian(bead.width))
    u_end = width / 6
    if bead.open_stop:
        return _checked(Tie(width / 2, float(np.hypot(torch.u_s_mm, u_end)), _START))
    surplus = float(bead.s[-1] - torch.s_mm[-1])
    miss = abs(surplus - width) / 2
    return _checked(Tie(surplus / 2, float(np.hypot(torch.u_s_mm, max(miss, u_end))), _BOTH))


def _checked(tie: Tie) -> Tie:
    if tie.u_s_mm > WORST_U_S_MM:
        raise EvidenceError(
            f"places on the bead are known to {tie.u_s_mm:.1f} mm only ({tie.method}), "
            f"{WORST_U_S_MM:g} mm are needed; check that photo and weld belong together"
        )
    return tie


def join_bead(session: "Session", weld: "Weld", bead: BeadMeasurement) -> Joined:
    """Log values at each station; `EvidenceError` where bead and log cannot be tied."""
    torch = torch_path(session, weld)
    tie = tie_bead(bead, torch)
    s_mm = bead.s - tie.offset_mm
    inside = (s_mm >= 0) & (s_mm <= torch.s_mm[-1])
    s_mm = s_mm[inside]
    stamp_ns = torch.stamp_at(s_mm)
    columns: dict[str, NDArray[Any]] = {
        "s_mm": s_mm,
        "stamp_ns": stamp_ns,
        "width_mm": np.where(bead.good, bead.width, np.nan)[inside],
        "u_width_mm": bead.u_width[inside],
        "speed_mm_s": torch.speed_at(stamp_ns),
    }
    columns |= _axis(session, stamp_ns) | _process(session, stamp_ns)
    power_kw = columns["current_a"] * columns["voltage_v"] / 1e3
    columns["heat_kj_mm"] = EFFICIENCY * power_kw / columns["speed_mm_s"]
    return Joined(columns, tie)


def _axis(session: "Session", stamp_ns: NDArray[np.int64]) -> dict[str, Floats]:
    record = load_axis_record(session)
    known = np.isfinite(record.position_m)
    return {
        "error_mm": _at(stamp_ns, record.stamp_ns[known], 1e3 * record.error_m[known]),
        "command": _at(stamp_ns, record.log_time_ns, record.command),
    }


def _process(session: "Session", stamp_ns: NDArray[np.int64]) -> dict[str, Floats]:
    try:
        process = session.columns(PROCESS)
    except ChannelMissing:
        unknown = np.full(len(stamp_ns), np.nan)
        return {"current_a": unknown, "voltage_v": unknown}
    return {
        name: _at(stamp_ns, process["stamp_ns"], process[name])
        for name in ("current_a", "voltage_v")
    }


def _at(wanted: NDArray[np.int64], stamp_ns: NDArray[np.int64], values: Floats) -> Floats:
    """Values at other stamps; NaN where the log does not reach."""
    if not len(stamp_ns):
        return np.full(len(wanted), np.nan)
    order = np.argsort(stamp_ns, kind="stable")
    start = stamp_ns[order[0]]
    at, known = (wanted - start).astype(np.float64), (stamp_ns[order] - start).astype(np.float64)
    return np.asarray(np.interp(at, known, values[order], left=np.nan, right=np.nan))
