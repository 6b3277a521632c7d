"""Quality as a part of the results: each limit that somebody gave, judged or not, with the reason.

Uniformity of width is judged by the user's own limits only: ISO 5817 has no number for it.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from seamlog.analysis.bead.part import BeadResult
from seamlog.errors import ConfigError
from seamlog.results import (
    Criterion,
    Figure,
    Finding,
    Input,
    Part,
    Severity,
    Verdict,
    worst,
)

from .capability import Capability, capability
from .judge import judge
from .standard import Level, Row, Sizes, Standard, limit_mm, load_standard
from .stations import STATION, doubt, station_criterion

_FROM_ABOVE = "a photo from above cannot measure it"
_CANDIDATES_ONLY = "a photo shows candidates only; a person or another method has to decide"
_DECIDED_BY_OTHERS = ("crack", "crater_crack", "pore_diameter_mm")
_NO_WIDTH_LEVEL = (
    "ISO 5817 has no numeric limit for irregular width (513): width is judged by your own limits"
)


class Limit(BaseModel):
    """Limits of one figure, in its unit; either may be left out."""

    model_config = ConfigDict(extra="forbid")

    lower: float | None = None
    upper: float | None = None


class QualityConfig(BaseModel):
    """Section `quality` of the configuration: limits of a drawing or procedure, and a standard.

    `limits` goes by the names of figures, `width_mm` is each station of the bead; `min_cpk` asks
    for capability. `level` asks for the rows of a standard: those of ISO 5817 that are shipped, or
    those of `table`.
    """

    model_config = ConfigDict(extra="forbid")

    limits: dict[str, Limit] = {}
    min_cpk: float | None = None
    level: Level | None = None
    weld: Literal["butt", "fillet"] | None = None
    plate_thickness_mm: float | None = None
    penetration_thickness_mm: float | None = None
    table: Path | None = None

    @property
    def asked(self) -> bool:
        """Whether anything is to be judged."""
        return bool(self.limits) or self.level is not None or self.min_cpk is not None


def quality_part(
    result: BeadResult,
    figures: Sequence[Figure],
    config: QualityConfig,
    inputs: Sequence[Input] = (),
    index: int = 1,
    weld: int | None = None,
) -> Part:
    """Part `quality` of one measured bead; `figures` are those of its bead and surface."""
    known = {figure.name: figure for figure in figures}
    _check_names(config, known)
    criteria = [
        _user_criterion(name, limit, result, known) for name, limit in config.limits.items()
    ]
    able = _capability(result, config)
    if config.min_cpk is not None:
        criteria.append(_cpk_criterion(able, config.min_cpk))
    findings = []
    source = ""
    if config.level is not None:
        standard = load_standard(config.table)
        source = standard.source
        criteria += _rows(standard, config, config.level, result, known)
        if config.table is None:
            findings.append(Finding(severity=Severity.INFO, message=_NO_WIDTH_LEVEL))
    return Part(
        part="quality",
        index=index,
        title=f"Quality, {result.photo.name.rsplit('/', 1)[-1]}",
        weld=weld,
        inputs=list(inputs),
        configuration=config.model_dump(mode="json"),
        verdict=worst([criterion.verdict for criterion in criteria]),
        reason=_reason(criteria),
        figures=_capability_figures(able),
        criteria=criteria,
        findings=findings,
        details={"standard": source},
    )


def _reason(criteria: Sequence[Criterion]) -> str:
    counted = [
        (verdict, sum(criterion.verdict is verdict for criterion in criteria))
        for verdict in (Verdict.FAIL, Verdict.PASS, Verdict.NOT_MEASURABLE, Verdict.NOT_ASSESSED)
    ]
    return ", ".join(f"{count} {verdict.value}" for verdict, count in counted if count)


def _check_names(config: QualityConfig, known: Mapping[str, Figure]) -> None:
    allowed = {STATION, *(name for name in known)}
    unit_free = {name.removesuffix("_px").removesuffix("_mm") for name in allowed}
    unknown = [
        name
        for name in config.limits
        if name not in allowed and name.removesuffix("_mm") not in unit_free
    ]
    if unknown:
        faults = tuple(f"quality.limits.{name}: no such figure" for name in unknown)
        names = ", ".join(sorted(allowed))
        raise ConfigError("\n".join(faults) + f"\nfigures that may have limits: {names}", faults)


def _user_criterion(
    name: str, limit: Limit, result: BeadResult, known: Mapping[str, Figure]
) -> Criterion:
    if name == STATION:
        return station_criterion(result.measurement, limit.lower, limit.upper)
    figure = known.get(name)
    if figure is None or not isinstance(figure.value, int | float):
        why = figure.reason if figure else "no calibration: there are no millimetres"
        return Criterion(
            name=name, label=figure.label if figure else name, value=None, lower=limit.lower,
            upper=limit.upper, verdict=Verdict.NOT_MEASURABLE, reason=why or "not measured",
        )  # fmt: skip
    verdict, reason = judge(figure.value, figure.u, limit.lower, limit.upper, figure.unit)
    if not result.measurement.trusted:
        verdict, reason = Verdict.NOT_MEASURABLE, doubt(result.measurement)
    return Criterion(
        name=name, label=figure.label, value=float(figure.value), unit=figure.unit, u=figure.u,
        lower=limit.lower, upper=limit.upper, verdict=verdict, reason=reason,
    )  # fmt: skip


def _capability(result: BeadResult, config: QualityConfig) -> Capability | None:
    m, even = result.measurement, result.uniformity
    limit = config.limits.get(STATION)
    if limit is None or even is None or m.unit != "mm" or not m.trusted:
        return None
    return capability(m.width[m.good], even.std, limit.lower, limit.upper)


def _cpk_criterion(able: Capability | None, least: float) -> Criterion:
    """PASS if the whole interval lies above, FAIL if it lies below."""
    common = {"name": "cpk", "label": "Capability Cpk of the width", "unit": "1", "lower": least}
    if able is None:
        return Criterion(
            **common, value=None, verdict=Verdict.NOT_MEASURABLE,
            reason="needs quality.limits.width_mm and a trusted width in mm",
        )  # fmt: skip
    passed, failed = able.cpk_low >= least, able.cpk_high < least
    verdict = Verdict.PASS if passed else Verdict.FAIL if failed else Verdict.NOT_MEASURABLE
    reason = f"95 % interval {able.cpk_low:.2f} to {able.cpk_high:.2f}"
    return Criterion(**common, value=able.cpk, verdict=verdict, reason=reason)


def _capability_figures(able: Capability | None) -> list[Figure]:
    if able is None:
        return []
    n = f"{able.independent:.0f} independent stations, measurement noise taken out"
    figures = []
    if able.cp is not None and able.cp_low is not None:
        interval = f"95 % interval {able.cp_low:.2f} to {able.cp_high:.2f}; {n}"
        figures.append(
            Figure(name="cp", label="Capability Cp", value=able.cp, unit="1", reason=interval)
        )
    interval = f"95 % interval {able.cpk_low:.2f} to {able.cpk_high:.2f}; {n}"
    cpk = Figure(name="cpk", label="Capability Cpk", value=able.cpk, unit="1", reason=interval)
    return [*figures, cpk]


def _rows(
    standard: Standard,
    config: QualityConfig,
    level: Level,
    result: BeadResult,
    known: Mapping[str, Figure],
) -> list[Criterion]:
    mean = known.get("width_mean_mm")
    trusted = result.measurement.trusted and mean is not None
    width = mean.value if trusted and mean and isinstance(mean.value, float) else None
    sizes = Sizes(t=config.plate_thickness_mm, s=config.penetration_thickness_mm, b=width)
    return [
        _row_criterion(row, level, sizes, config.weld, known)
        for row in standard.row
        if row.weld is None or config.weld in (None, row.weld)
    ]


def _row_criterion(
    row: Row, level: Level, sizes: Sizes, weld: str | None, known: Mapping[str, Figure]
) -> Criterion:
    upper, reason = limit_mm(row, level, sizes)
    verdict = Verdict.NOT_ASSESSED
    figure = known.get(row.figure)
    value = figure.value if figure and isinstance(figure.value, int | float) else None
    if row.weld is not None and weld is None:
        upper, reason = None, f"say whether it is a {row.weld} weld (quality.weld)"
    elif upper is not None and row.figure in _DECIDED_BY_OTHERS:
        verdict, reason = Verdict.NOT_MEASURABLE, _CANDIDATES_ONLY
    elif upper is not None and value is None:
        verdict = Verdict.NOT_MEASURABLE
        reason = figure.reason if figure and figure.reason else _FROM_ABOVE
    elif upper is not None and figure is not None and value is not None:
        verdict, reason = judge(float(value), figure.u, None, upper, "mm")
    return Criterion(
        name=f"iso_{row.number}".replace(", ", "_"),
        label=f"{row.number} {row.name}, level {level}",
        value=None if value is None else float(value),
        unit="mm",
        u=figure.u if figure else None,
        upper=upper,
        verdict=verdict,
        reason=reason,
    )
