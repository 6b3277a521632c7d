"""The join as a part of the results: stations with log values, excursions and what moved there."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ChannelMissing, EvidenceError
from seamlog.results import Figure, Finding, Input, Part, Place, Severity

from .bead.measurement import BeadMeasurement
from .bead.part import BeadConfig
from .bead.plane import Plane
from .excursions import (
    Band,
    Cause,
    Excursion,
    find_excursions,
    lagged_correlation,
    rank_causes,
    usual_band,
)
from .join import join_bead
from .part_tables import Tables
from .registration import Tie

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld

Floats = NDArray[np.float64]

_CHANNELS = {
    "weld_speed": ("weld speed", "speed_mm_s", "mm/s"),
    "tracking_error": ("tracking error (magnitude)", "error_mm", "mm"),
    "command": ("command", "command", ""),
    "current": ("welding current", "current_a", "A"),
    "voltage": ("arc voltage", "voltage_v", "V"),
}


def join_part(
    session: "Session",
    weld: "Weld",
    bead: BeadMeasurement,
    config: BeadConfig | None = None,
    inputs: Sequence[Input] = (),
    plane: Plane | None = None,
) -> tuple[Part, Tables]:
    """Part `join` of one weld and one photo, with table `stations`."""
    config = config or BeadConfig()
    try:
        joined = join_bead(session, weld, bead, plane)
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
        figures=[*_figures(tie, band, len(found)), _heat(columns["heat_kj_mm"], joined.heat_rule)],
        findings=[_finding(columns, weld, band, *item) for item in found],
        details={
            "method": tie.method,
            "offset_mm": tie.offset_mm,
            "u_s_mm": tie.u_s_mm,
            "backwards": tie.backwards,
            "start_ns": weld.start_ns,
            "end_ns": weld.end_ns,
            "causes": [_cause_details(columns, *item) for item in found],
            "correlations": _correlations(columns),
        },
    )
    tables: Tables = {"stations": (columns, _units(session))}
    if rows := part.details["correlations"]:
        tables["correlations"] = _correlation_table(rows)
    return part, tables


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
    width, u_mm = columns["width_mm"], columns["u_width_mm"]
    excursions = find_excursions(columns["s_mm"], width, u_mm, band)
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


def _heat(heat_kj_mm: Floats, rule: str) -> Figure:
    known = heat_kj_mm[np.isfinite(heat_kj_mm)]
    return Figure(
        name="heat_input_kj_mm",
        label="Mean heat input",
        value=float(known.mean()) if len(known) else None,
        unit="kJ/mm",
        reason=rule if len(known) else "current and voltage were not logged",
    )


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


def _correlation_table(
    rows: list[dict[str, Any]],
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Which channel the width goes along with, and how far behind it; the closest first."""
    ordered = sorted(rows, key=lambda row: -abs(row["r"]))
    columns = {
        "channel": np.array([_CHANNELS[row["channel"]][0] for row in ordered], dtype=object),
        "correlation": np.array([row["r"] for row in ordered]),
        "lag_mm": np.array([row["lag_mm"] for row in ordered]),
    }
    return columns, {"correlation": "1", "lag_mm": "mm"}


def _correlations(columns: dict[str, NDArray[Any]]) -> list[dict[str, Any]]:
    rows = []
    for name, values in _channels(columns).items():
        found = lagged_correlation(columns["s_mm"], columns["width_mm"], values)
        if found is not None:
            rows.append({"channel": name, "r": found[0], "lag_mm": found[1]})
    return rows
