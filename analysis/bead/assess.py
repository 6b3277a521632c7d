"""Photos to parts of results: measured, or refused with the reason."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

from seamlog.errors import EvidenceError, ImageError, SeamlogError
from seamlog.results import Figure, Part, Verdict

from .loops import MANY, as_machine_code
from .measurement import TRUSTED
from .part import (
    BeadConfig,
    BeadResult,
    Pictures,
    Tables,
    bead_part,
    measure_photo,
    other_toe,
    with_other_toe,
)
from .plane import Points
from .sources import PhotoSource


@dataclass(frozen=True, slots=True)
class AssessedPhoto:
    """A photo's part with its tables and pictures; `refusal` where it could not be measured."""

    part: Part
    tables: Tables
    pictures: Pictures
    result: BeadResult | None
    refusal: SeamlogError | None = None
    name: str = field(default="")

    def summary(self) -> dict[str, Any]:
        """The figures of one photo, JSON-ready."""
        if self.result is None:
            return {
                "photo": self.name,
                "verdict": self.part.verdict.value,
                "refused": str(self.refusal),
            }
        return {"photo": self.name, **_summary(self.part, self.result)}


def _summary(part: Part, result: BeadResult) -> dict[str, Any]:
    m, even, aside = result.measurement, result.uniformity, result.by_other_toe
    return {
        "verdict": part.verdict.value,
        "refused": None,
        "unit": m.unit,
        f"mean_width_{m.unit}": even.mean if even else None,
        "u_mean_width": even.u_mean if even else None,
        "width_std": even.std if even else None,
        "width_cv": even.cv if even else None,
        "range": even.width_range if even else None,
        "peak_to_peak_25mm": even.peak_to_peak_25mm if even else None,
        "stations": len(m.s),
        "flagged": int((~m.good).sum()),
        "confidence": m.confidence,
        "trusted_from": TRUSTED,
        "toe_definition": m.toe_definition,
        "other_toe": other_toe(part.configuration["toe"]),
        "mean_width_by_other_toe": aside.mean if aside else None,
        "starts_at": m.starts_at,
        "warnings": list(m.warnings),
    }


def assess_photos(
    sources: Sequence[PhotoSource],
    start: str | None = None,
    config: BeadConfig | None = None,
    weld: int | None = None,
    seam_mm: Points | None = None,
) -> list[AssessedPhoto]:
    """Part `bead` of each photo, indexed in order; a refused photo keeps its place."""
    with as_machine_code() if len(sources) >= MANY else nullcontext():
        return [
            _assess(source, start, config or BeadConfig(), index, weld, seam_mm)
            for index, source in enumerate(sources, 1)
        ]


def _assess(
    source: PhotoSource,
    start: str | None,
    config: BeadConfig,
    index: int,
    weld: int | None,
    seam_mm: Points | None,
) -> AssessedPhoto:
    name = source.photo.name
    try:
        measured = measure_photo(source.photo, source.calibration, start, config, seam_mm)
    except (EvidenceError, ImageError) as error:
        part = _refused(source, config, index, weld, str(error))
        return AssessedPhoto(part, {}, {}, None, error, name)
    result = with_other_toe(measured, start, config, seam_mm)
    part, tables, pictures = bead_part(result, source.inputs, config, index, weld)
    if source.calibration is not None:
        known = source.calibration.model_dump(
            include={"kind", "date", "source", "residual_mm", "scale_relative_u"}
        )
        part = part.model_copy(update={"details": part.details | {"calibration": known}})
    return AssessedPhoto(part, tables, pictures, result, None, name)


def _refused(
    source: PhotoSource, config: BeadConfig, index: int, weld: int | None, reason: str
) -> Part:
    unit = "px" if source.calibration is None else "mm"
    return Part(
        part="bead",
        index=index,
        title=f"Bead width, {source.photo.name.rsplit('/', 1)[-1]}",
        weld=weld,
        inputs=list(source.inputs),
        configuration=config.model_dump(),
        verdict=Verdict.NOT_MEASURABLE,
        reason=reason,
        figures=[Figure(name=f"width_mean_{unit}", label="Mean width", value=None, reason=reason)],
    )
