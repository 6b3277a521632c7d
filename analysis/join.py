"""The join: each station of the bead tied to the moment at which the torch was there.

Where photo and log are not surely tied to each other (`registration`), nothing is joined.
"""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ChannelMissing

from .axis_record import load_axis_record
from .bead.measurement import BeadMeasurement
from .bead.plane import Plane
from .bead.stitch import backwards
from .registration import Tie, tie_bead
from .torch_path import torch_path

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld

Floats = NDArray[np.float64]

EFFICIENCY = {"12": 1.0, "11": 0.8, "13": 0.8, "14": 0.6, "15": 0.6}
"""Thermal efficiency by EN 1011-1, by the first digits of the process number of ISO 4063."""
USUAL_EFFICIENCY = 0.8
"""Of MIG and MAG welding, taken where the session does not say the process."""
PROCESS = "/weld/process"


@dataclass(frozen=True, slots=True)
class Joined:
    """Columns per station, in the order of the weld; what was not logged is NaN."""

    columns: dict[str, NDArray[Any]]
    tie: Tie
    heat_rule: str


def join_bead(
    session: "Session", weld: "Weld", bead: BeadMeasurement, plane: Plane | None = None
) -> Joined:
    """Log values at each station; `EvidenceError` where bead and log cannot be tied."""
    torch = torch_path(session, weld)
    tie = tie_bead(bead, torch, plane)
    if tie.backwards:
        bead = backwards(bead)
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
    process = session.metadata.get("seamlog.weld", {}).get("process", "")
    efficiency, known = thermal_efficiency(process)
    columns["heat_kj_mm"] = efficiency * power_kw / columns["speed_mm_s"]
    said = "" if known else ", process not recorded"
    return Joined(columns, tie, f"EN 1011-1, thermal efficiency {efficiency:g}{said}")


def thermal_efficiency(process: str) -> tuple[float, bool]:
    """Efficiency of a process whose number stands in this text, and whether it does."""
    number = re.search(r"(?<!\d)1[1-5]\d?(?!\d)", process)
    found = EFFICIENCY.get(number[0][:2]) if number else None
    return (USUAL_EFFICIENCY, False) if found is None else (found, True)


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
