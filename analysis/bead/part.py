"""The bead as a part of the results: figures, criteria, findings, stations, overlay."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from seamlog.analysis.quality.judge import judge
from seamlog.analysis.quality.stations import doubt, station_criterion
from seamlog.calibration import Calibration
from seamlog.errors import EvidenceError, ImageError
from seamlog.plugins import load
from seamlog.results import (
    Columns,
    Criterion,
    Figure,
    Finding,
    Input,
    Part,
    Picture,
    Place,
    Severity,
    Verdict,
    worst,
)

from .image import Photo
from .measurement import END, TOES, BeadDetector, BeadMeasurement
from .overlay import overlay_webp
from .plane import Plane, Points, plane_of
from .uniformity import Uniformity, uniformity

Tables = Mapping[str, tuple[Columns, Mapping[str, str]]]
Pictures = Mapping[str, tuple[bytes, Picture]]


class BeadConfig(BaseModel):
    """Section `bead` of the configuration: detector, toe definition, the user's limits if any."""

    model_config = ConfigDict(extra="forbid")

    detector: str = "strip"
    toe: Literal["metal", "outer"] = "metal"
    min_width_mm: float | None = None
    max_width_mm: float | None = None
    max_width_cv: float | None = None


@dataclass(frozen=True, slots=True)
class BeadResult:
    """A measured photo with all that a part of the results needs."""

    photo: Photo
    measurement: BeadMeasurement
    uniformity: Uniformity | None
    plane: Plane | None = None
    calibration: Calibration | None = None
    by_other_toe: Uniformity | None = None
    """Figures by the other definition of the toe, where these can be trusted as well."""


def measure_photo(
    photo: Photo,
    calibration: Calibration | None = None,
    start: str | None = None,
    config: BeadConfig | None = None,
    seam_mm: Points | None = None,
) -> BeadResult:
    """Measure the bead in a photo with the configured detector.

    `start` tells at which end of the photo the weld began: left, right, top or bottom. `seam_mm`
    is the logged path of the seam in the table frame, (n, 2): a photo in that frame is searched
    along it first. Raises `EvidenceError` (no bead to be told), `ImageError`, `CalibrationError`,
    `UnknownName`.
    """
    config = config or BeadConfig()
    detector: BeadDetector = load("seamlog.bead_detectors", config.detector)
    plane = plane_of(photo, calibration)
    measurement = None
    if seam_mm is not None and plane.in_table_frame:
        with contextlib.suppress(EvidenceError):
            measurement = detector(photo, plane, seam_mm, start, config.toe)
    if measurement is None:
        measurement = detector(photo, plane, start=start, toe=config.toe)
    return BeadResult(photo, measurement, uniformity(measurement), plane, calibration)


def with_other_toe(
    result: BeadResult, start: str | None, config: BeadConfig, seam_mm: Points | None
) -> BeadResult:
    """`result` with the figures that the other definition of the toe gives for its photo."""
    other = config.model_copy(update={"toe": other_toe(config.toe)})
    with contextlib.suppress(EvidenceError, ImageError):
        found = measure_photo(result.photo, result.calibration, start, other, seam_mm)
        if found.measurement.trusted:
            return replace(result, by_other_toe=found.uniformity)
    return result


def other_toe(toe: str) -> str:
    """The other one of the two definitions."""
    return next(name for name in TOES if name != toe)


def bead_part(
    result: BeadResult,
    inputs: Sequence[Input] = (),
    config: BeadConfig | None = None,
    index: int = 1,
    weld: int | None = None,
) -> tuple[Part, Tables, Pictures]:
    """Part `bead` of one photo, with table `stations` and picture `overlay`."""
    config = config or BeadConfig()
    m = result.measurement
    criteria = _criteria(result, config)
    part = Part(
        part="bead",
        index=index,
        title=f"Bead width, {result.photo.name.rsplit('/', 1)[-1]}",
        weld=weld,
        inputs=list(inputs),
        configuration=config.model_dump(),
        verdict=worst([criterion.verdict for criterion in criteria]),
        reason=_reason(criteria),
        figures=_figures(result, other_toe(config.toe)),
        criteria=criteria,
        findings=_findings(m, weld),
        details={
            "unit": m.unit,
            "toe_definition": m.toe_definition,
            "starts_at": m.starts_at,
            "direction_known": m.direction_known,
            "open_start": m.open_start,
            "open_stop": m.open_stop,
            "photo_width_px": result.photo.width_px,
            "photo_height_px": result.photo.height_px,
            **_calibrated(result.calibration),
        },
    )
    return part, {"stations": _stations(m)}, {"overlay": _picture(result)}


def _calibrated(calibration: Calibration | None) -> dict[str, Any]:
    """What the inspection record says of the calibration."""
    if calibration is None:
        return {}
    told = {"kind", "source", "date", "residual_mm", "scale_relative_u"}
    return {"calibration": calibration.model_dump(mode="json", include=told)}


def _stations(m: BeadMeasurement) -> tuple[Columns, Mapping[str, str]]:
    unit = m.unit
    columns = {
        f"s_{unit}": m.s,
        f"width_{unit}": m.width,
        f"u_width_{unit}": m.u_width,
        f"u_noise_{unit}": m.u_noise,
        "left_x_px": m.left_px[:, 0],
        "left_y_px": m.left_px[:, 1],
        "right_x_px": m.right_px[:, 0],
        "right_y_px": m.right_px[:, 1],
        "centre_x_px": m.centre_px[:, 0],
        "centre_y_px": m.centre_px[:, 1],
        "flagged": m.flagged,
        "reason": np.array(m.reason, dtype=object),
    }
    units = {name: name.rsplit("_", 1)[-1] for name in columns if "_" in name}
    return columns, units


def _picture(result: BeadResult) -> tuple[bytes, Picture]:
    data, width, height = overlay_webp(result.photo, result.measurement)
    caption = "Photo with both toes (green; red where flagged) and the centreline; ring: s = 0"
    picture = Picture(
        file="overlay.webp", caption=caption, width_px=width, height_px=height, sha256=""
    )
    return data, picture


def _figures(result: BeadResult, other: str) -> list[Figure]:
    m, even = result.measurement, result.uniformity
    unit = m.unit
    why = "" if m.trusted else f"low confidence ({m.confidence:.2f})"
    if even is None:
        reason = "fewer than three stations could be measured"
        return [Figure(name=f"width_mean_{unit}", label="Mean width", value=None, reason=reason)]
    span = even.peak_to_peak_25mm
    no_span = "needs a calibration and 25 mm of bead"
    figures = [
        Figure(name=f"width_mean_{unit}", label="Mean width", value=even.mean, unit=unit,
               u=even.u_mean, reason=why),
        Figure(name=f"width_std_{unit}", label="Standard deviation of the width, noise taken out",
               value=even.std, unit=unit, reason=why),
        Figure(name="width_cv", label="Coefficient of variation, noise taken out",
               value=even.cv, unit="1", reason=why),
        Figure(name=f"width_range_{unit}", label="Range of the width", value=even.width_range,
               unit=unit, reason=why),
        Figure(name="peak_to_peak_25mm", label="Largest peak to peak within 25 mm (1 mm means)",
               value=span, unit=unit if span is not None else "", reason=no_span if span is None
               else why),
        Figure(name="stations", label="Stations", value=len(m.s), unit="1"),
        Figure(name="flagged", label="Flagged stations", value=int((~m.good).sum()), unit="1"),
        Figure(name="confidence", label="Confidence, 0 to 1", value=m.confidence, unit="1"),
        Figure(name="toe_definition", label="Toe definition", value=m.toe_definition),
    ]  # fmt: skip
    name, label = f"width_mean_{other}_toe_{unit}", f"Mean width by the {other} toe"
    if aside := result.by_other_toe:
        figures.append(Figure(name=name, label=label, value=aside.mean, unit=unit, u=aside.u_mean))
    elif result.plane is not None:
        figures.append(Figure(name=name, label=label, value=None, reason="no width to trust"))
    return figures


def _criteria(result: BeadResult, config: BeadConfig) -> list[Criterion]:
    criteria = []
    if config.min_width_mm is not None or config.max_width_mm is not None:
        limits = (config.min_width_mm, config.max_width_mm)
        criteria.append(station_criterion(result.measurement, *limits))
    if config.max_width_cv is not None:
        even, m = result.uniformity, result.measurement
        value = even.cv if even else None
        verdict, reason = judge(value, None, None, config.max_width_cv)
        if not m.trusted:
            verdict, reason = Verdict.NOT_MEASURABLE, doubt(m)
        criteria.append(
            Criterion(
                name="width_cv", label="Evenness of the width", value=value, unit="1",
                upper=config.max_width_cv, verdict=verdict, reason=reason,
            )
        )  # fmt: skip
    return criteria


def _reason(criteria: list[Criterion]) -> str:
    if not criteria:
        return "no limits for the width were given"
    return "; ".join(criterion.reason for criterion in criteria if criterion.reason)


def _findings(m: BeadMeasurement, weld: int | None) -> list[Finding]:
    findings = [Finding(severity=Severity.WARNING, message=text) for text in m.warnings]
    for start, stop, reason in gaps(m):
        if reason == END:
            continue
        length = f"{m.s[stop] - m.s[start]:.1f} {m.unit}"
        place = Place(s_mm=float(m.s[start]), weld=weld) if m.unit == "mm" else None
        findings.append(
            Finding(severity=Severity.WARNING, message=f"gap of {length}: {reason}", place=place)
        )
    return findings


def gaps(m: BeadMeasurement, shortest: float = 1.0) -> list[tuple[int, int, str]]:
    """Runs of stations without a width to trust (first, last, reason), longer than `shortest`.

    `shortest` is in mm, or in median widths / 6 without calibration.
    """
    least = shortest if m.unit == "mm" else shortest * float(np.nanmedian(m.width)) / 6
    bad = np.concatenate([[False], ~m.good, [False]])
    edges = np.flatnonzero(np.diff(bad.astype(np.int8))).reshape(-1, 2)
    found = []
    for start, stop in edges:
        if m.s[stop - 1] - m.s[start] >= least:
            reasons = [reason for reason in m.reason[start:stop] if reason]
            found.append((int(start), int(stop - 1), max(set(reasons), key=reasons.count)))
    return found
