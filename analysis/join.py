"""The join: each station of the bead tied to the moment at which the torch was there.

The bead's start and stop on the photo are tied to arc on and arc off; which end is the start
somebody has to say. Without that, or where the tie is worse than 5 mm, nothing is joined.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ChannelMissing, EvidenceError
from seamlog.results import Figure, Finding, Input, Part, Place, Severity

from .axis_record import load_axis_record
from .bead.measurement import BeadMeasurement
from .bead.part import BeadConfig
from .excursions import (
    Band,
    Cause,
    Excursion,
    find_excursions,
    lagged_correlation,
    rank_causes,
    usual_band,
)
from .part_tables import Tables
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
_CHANNELS = {
    "weld_speed": ("weld speed", "speed_mm_s", "mm/s"),
    "tracking_error": ("tracking error (magnitude)", "error_mm", "mm"),
    "command": ("command", "command", ""),
    "current": ("welding current", "current_a", "A"),
    "voltage": ("arc voltage", "voltage_v", "V"),
}


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


def join_part(
    session: "Session",
    weld: "Weld",
    bead: BeadMeasurement,
    config: BeadConfig | None = None,
    inputs: Sequence[Input] = (),
) -> tuple[Part, Tables]:
    """Part `join` of one weld and one photo, with table `stations`."""
    config = config or BeadConfig()
    try:
        joined = join_bead(session, weld, bead)
    except (EvidenceError, ChannelMissing) as error:
        return no_join(str(error), weld, inputs), {}
    columns, tie = joined.columns, joined.tie
    band = usual_band(columns["width_mm"], config.min_width_mm, config.max_width_mm)
    found = _explained(columns, band)
    part = Part(
        part="join",
        index=weld.number,
        title=f"Bead and log of weld {weld.number}",
        weld=weld.number,
        inputs=list(inputs),
        configuration=config.model_dump(),
        reason="a join is not judged",
        figures=_figures(tie, band, len(found)),
        findings=[_finding(columns, weld, band, *item) for item in found],
        details={
            "method": tie.method,
            "offset_mm": tie.offset_mm,
            "u_s_mm": tie.u_s_mm,
            "start_ns": weld.start_ns,
            "end_ns": weld.end_ns,
            "causes": [_cause_details(columns, *item) for item in found],
            "correlations": _correlations(columns),
        },
    )
    return part, {"stations": (columns, _units(session))}


def no_join(reason: str, weld: "Weld | None", inputs: Sequence[Input]) -> Part:
    """The part of a bead that cannot be tied to the log: NOT ASSESSED with the reason."""
    number = weld.number if weld else None
    return Part(
        part="join",
        index=number or 1,
        title="Bead and log",
        weld=number,
        inputs=list(inputs),
        reason=reason,
        figures=[Figure(name="u_s_mm", label="Tie of bead and log", value=None, reason=reason)],
        details={"method": None, "causes": []},
    )


def _units(session: "Session") -> dict[str, str]:
    units = {"s_mm": "mm", "stamp_ns": "ns", "width_mm": "mm", "u_width_mm": "mm"}
    units |= {"speed_mm_s": "mm/s", "error_mm": "mm", "current_a": "A", "voltage_v": "V"}
    command = session.channel_metadata("/table/command").get("unit", "")
    return units | {"heat_kj_mm": "kJ/mm", "command": command}


def _channels(columns: dict[str, NDArray[Any]]) -> dict[str, Floats]:
    values = {name: columns[column] for name, (_, column, _) in _CHANNELS.items()}
    values["tracking_error"] = np.abs(values["tracking_error"])
    return {name: column for name, column in values.items() if np.isfinite(column).any()}


def _explained(columns: dict[str, NDArray[Any]], band: Band) -> list[tuple[Excursion, list[Cause]]]:
    channels = _channels(columns)
    least = {name: 0.005 * float(np.nanmedian(np.abs(v))) for name, v in channels.items()}
    least["tracking_error"] = 0.02
    excursions = find_excursions(columns["s_mm"], columns["width_mm"], band)
    width = columns["width_mm"]
    return [(each, rank_causes(each, width, channels, least)) for each in excursions]


def _figures(tie: Tie, band: Band, count: int) -> list[Figure]:
    return [
        Figure(name="excursions", label="Places where the width leaves its band", value=count),
        Figure(
            name="band_low_mm", label="Band of the width, lower", value=_finite(band.low_mm),
            unit="mm", reason=band.source,
        ),
        Figure(
            name="band_high_mm", label="Band of the width, upper", value=_finite(band.high_mm),
            unit="mm", reason=band.source,
        ),
        Figure(
            name="u_s_mm", label="Uncertainty of places against the log", value=tie.u_s_mm,
            unit="mm", reason=tie.method,
        ),
    ]  # fmt: skip


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _finding(
    columns: dict[str, NDArray[Any]],
    weld: "Weld",
    band: Band,
    excursion: Excursion,
    causes: list[Cause],
) -> Finding:
    s_mm = columns["s_mm"]
    word = "wide" if excursion.peak_width_mm > band.high_mm else "narrow"
    extreme = "at most" if word == "wide" else "at least"
    text = (
        f"bead {word} from {s_mm[excursion.first]:.0f} to {s_mm[excursion.last]:.0f} mm, "
        f"{excursion.peak_width_mm:.2f} mm {extreme}; {_because(causes)}"
    )
    place = Place(s_mm=excursion.s_mm, time_ns=_moment(columns, excursion), weld=weld.number)
    return Finding(severity=Severity.WARNING, message=text, place=place)


def _because(causes: list[Cause]) -> str:
    if not causes or not causes[0].moved:
        return "no logged channel moved there"
    first = causes[0]
    label, _, unit = _CHANNELS[first.channel]
    text = f"the {label} was {first.there:.3g} {unit} there instead of {first.usual:.3g} {unit}"
    text = f"{text.replace('  ', ' ')} ({first.score:.0f} standard deviations"
    if len(causes) > 1:
        text += f"; next: {_CHANNELS[causes[1].channel][0]}, {causes[1].score:.0f}"
    return text + ")"


def _moment(columns: dict[str, NDArray[Any]], excursion: Excursion) -> int:
    return int(columns["stamp_ns"][int(np.argmin(np.abs(columns["s_mm"] - excursion.s_mm)))])


def _cause_details(
    columns: dict[str, NDArray[Any]], excursion: Excursion, causes: list[Cause]
) -> dict[str, Any]:
    first = causes[0] if causes and causes[0].moved else None
    return {
        "channel": first.channel if first else None,
        "s_mm": excursion.s_mm,
        "stamp_ns": _moment(columns, excursion),
        "width_mm": excursion.peak_width_mm,
        "score": first.score if first else None,
        "ranking": [
            {"channel": cause.channel, "score": cause.score, "correlation": cause.correlation}
            for cause in causes
        ],
    }


def _correlations(columns: dict[str, NDArray[Any]]) -> list[dict[str, Any]]:
    rows = []
    for name, values in _channels(columns).items():
        found = lagged_correlation(columns["s_mm"], columns["width_mm"], values)
        if found is not None:
            rows.append({"channel": name, "r": found[0], "lag_mm": found[1]})
    return rows
