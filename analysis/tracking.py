"""How well the table followed its reference, weld by weld, and how fast the torch went."""

from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from seamlog.errors import EvidenceError
from seamlog.results import (
    Criterion,
    Figure,
    Finding,
    Input,
    Part,
    Place,
    Severity,
    Verdict,
    input_of,
    worst,
)

from .axis_record import AxisRecord, FloatArray, load_axis_record
from .part_tables import Tables
from .torch_path import TorchPath, torch_path

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld


class TrackingLimits(BaseModel):
    """What section `limits` of the configuration says about tracking."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    tracking_error_mm: float | None = Field(None, gt=0)
    """Largest magnitude of the tracking error during a weld."""


def tracking_parts(
    session: "Session", welds: list["Weld"], limits: TrackingLimits
) -> list[tuple[Part, Tables]]:
    """Part `tracking` for each weld; for the whole record of a session without welds."""
    record = load_axis_record(session)
    inputs = [input_of(path) for path in session.paths]
    if not record.has_reference:
        reason = "the session has no /table/reference: without it there is no tracking error"
        return [(unknown_tracking(reason, inputs), {})]
    if not welds:
        return [_tracking(record, None, None, "the session has no weld", limits, inputs)]
    parts = []
    for weld in welds:
        rows = record.between(weld.start_ns, weld.end_ns)
        path, reason = _torch(session, weld)
        parts.append(_tracking(rows, weld, path, reason, limits, inputs))
    return parts


def _torch(session: "Session", weld: "Weld") -> tuple[TorchPath | None, str]:
    try:
        return torch_path(session, weld), ""
    except EvidenceError as error:
        return None, str(error)


def unknown_tracking(reason: str, inputs: list[Input]) -> Part:
    """The part of a session that cannot tell how well it tracked."""
    none = Figure(name="rms_error_mm", label="rms tracking error", value=None, reason=reason)
    return Part(part="tracking", title="Tracking", reason=reason, inputs=inputs, figures=[none])


def _tracking(
    record: AxisRecord,
    weld: "Weld | None",
    path: TorchPath | None,
    path_reason: str,
    limits: TrackingLimits,
    inputs: list[Input],
) -> tuple[Part, Tables]:
    error_mm = 1e3 * record.error_m
    known = np.isfinite(error_mm)
    number = weld.number if weld else None
    worst_at = _worst_place(record, error_mm, path, number)
    criteria = _criteria(error_mm[known], worst_at, limits)
    verdict = worst([criterion.verdict for criterion in criteria])
    part = Part(
        part="tracking",
        index=number or 1,
        title=f"Tracking, weld {number}" if weld else "Tracking",
        weld=number,
        inputs=inputs,
        configuration=limits.model_dump(),
        verdict=verdict,
        reason="" if criteria else "no limit was given (limits.tracking_error_mm)",
        figures=[*_error_figures(error_mm[known]), *_speed_figures(path, path_reason)],
        criteria=criteria,
        findings=_findings(worst_at, error_mm, known),
        details=_span(record, weld),
    )
    return part, _tables(record, error_mm, path)


def _span(record: AxisRecord, weld: "Weld | None") -> dict[str, int]:
    if weld is not None:
        return {"start_ns": weld.start_ns, "end_ns": weld.end_ns}
    if not len(record):
        return {}
    return {"start_ns": int(record.log_time_ns[0]), "end_ns": int(record.log_time_ns[-1])}


def _worst_place(
    record: AxisRecord, error_mm: FloatArray, path: TorchPath | None, weld: int | None
) -> Place | None:
    if not np.isfinite(error_mm).any():
        return None
    row = int(np.nanargmax(np.abs(error_mm)))
    stamp = record.stamp_ns[row : row + 1]
    s_mm = float(path.at(stamp)[0]) if path is not None else float("nan")
    known = s_mm if np.isfinite(s_mm) else None
    return Place(s_mm=known, time_ns=int(stamp[0]), weld=weld)


def _error_figures(error_mm: FloatArray) -> list[Figure]:
    if not len(error_mm):
        reason = "no control period has both reference and measurement"
        return [Figure(name="rms_error_mm", label="rms tracking error", value=None, reason=reason)]
    size = np.abs(error_mm)
    rows = (
        ("rms_error_mm", "rms tracking error", float(np.sqrt(np.mean(error_mm**2)))),
        ("peak_error_mm", "peak tracking error", float(size.max())),
        ("p95_error_mm", "tracking error, 95 % of the time below", float(np.quantile(size, 0.95))),
        ("mean_error_mm", "mean tracking error", float(error_mm.mean())),
    )
    return [Figure(name=name, label=label, value=value, unit="mm") for name, label, value in rows]


def _speed_figures(path: TorchPath | None, reason: str) -> list[Figure]:
    rows: list[tuple[str, str, float | None, float | None, str]] = [
        ("weld_length_mm", "length of the weld", None, None, "mm"),
        ("mean_weld_speed_mm_s", "mean weld speed", None, None, "mm/s"),
        ("lowest_weld_speed_mm_s", "lowest weld speed", None, None, "mm/s"),
    ]
    if path is not None:
        seconds = float(path.stamp_ns[-1] - path.stamp_ns[0]) * 1e-9
        length, u_length = float(path.s_mm[-1]), path.u_s_mm
        found = (
            (length, u_length),
            (length / seconds, u_length / seconds),
            (float(path.speed_mm_s.min()), path.u_speed_mm_s),
        )
        rows = [(*row[:2], *values, row[4]) for row, values in zip(rows, found, strict=True)]
    return [
        Figure(name=name, label=label, value=value, u=u, unit=unit, reason=reason)
        for name, label, value, u, unit in rows
    ]


def _criteria(error_mm: FloatArray, place: Place | None, limits: TrackingLimits) -> list[Criterion]:
    limit = limits.tracking_error_mm
    if limit is None:
        return []
    value = float(np.abs(error_mm).max()) if len(error_mm) else None
    if value is None:
        verdict, reason = Verdict.NOT_MEASURABLE, "no control period has an error"
    else:
        verdict, reason = (Verdict.PASS if value <= limit else Verdict.FAIL), ""
    return [
        Criterion(
            name="tracking_error_mm",
            label="peak tracking error",
            value=value,
            unit="mm",
            upper=limit,
            verdict=verdict,
            reason=reason,
            place=place,
        )
    ]


def _findings(place: Place | None, error_mm: FloatArray, known: Any) -> list[Finding]:
    findings = []
    if place is not None:
        peak = float(np.nanmax(np.abs(error_mm)))
        text = f"largest tracking error {peak:.2f} mm"
        findings.append(Finding(severity=Severity.INFO, message=text, place=place))
    missing = int((~known).sum())
    if missing:
        text = f"{missing} control periods have no tracking error: reference or measurement missing"
        findings.append(Finding(severity=Severity.WARNING, message=text))
    return findings


def _tables(record: AxisRecord, error_mm: FloatArray, path: TorchPath | None) -> Tables:
    columns = {
        "stamp_ns": record.stamp_ns,
        "reference_mm": 1e3 * record.reference_m,
        "measurement_mm": 1e3 * record.position_m,
        "error_mm": error_mm,
        "command": record.command,
    }
    lengths = dict.fromkeys(("reference_mm", "measurement_mm", "error_mm"), "mm")
    units = {"stamp_ns": "ns", "command": record.drive.unit} | lengths
    tables: Tables = {"error": (columns, units)}
    if path is not None:
        speed = {"stamp_ns": path.stamp_ns, "s_mm": path.s_mm, "speed_mm_s": path.speed_mm_s}
        tables["speed"] = (speed, {"stamp_ns": "ns", "s_mm": "mm", "speed_mm_s": "mm/s"})
    return tables
