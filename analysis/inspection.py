"""Measured photos to parts: bead, surface and, where limits were given, quality."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from seamlog.errors import EvidenceError
from seamlog.results import Figure, Part, Verdict

from .bead.assess import AssessedPhoto
from .bead.part import BeadConfig, BeadResult, Pictures, Tables, bead_part
from .bead.sources import Before
from .bead.stitch import stitch
from .bead.uniformity import uniformity
from .quality.part import QualityConfig, quality_part
from .surface.part import surface_part

Inspected = tuple[Part, Tables, Pictures]


@dataclass(frozen=True, slots=True)
class InspectionSettings:
    """What photos are inspected for: limits, and a picture from before welding to compare with."""

    quality: QualityConfig = field(default_factory=QualityConfig)
    before: Before | None = None
    heights: tuple[Figure, ...] = ()
    """Figures of a laser stripe, where the log has one."""


def stitched(assessed: Sequence[AssessedPhoto], config: BeadConfig) -> AssessedPhoto | str:
    """Several photos as one bead, its part behind theirs; or why they are not stitched."""
    results = [item.result for item in assessed if item.result is not None]
    if len(results) < 2 or len(results) < len(assessed):
        return "not all photos could be measured" if len(assessed) > 1 else ""
    try:
        found = stitch([r.photo for r in results], [r.measurement for r in results])
    except EvidenceError as error:
        return str(error)
    whole = BeadResult(found.photo, found.measurement, uniformity(found.measurement))
    inputs = [item for each in assessed for item in each.part.inputs]
    unique = list({item.sha256: item for item in inputs}.values())
    first = assessed[0].part
    part, tables, pictures = bead_part(whole, unique, config, len(assessed) + 1, first.weld)
    names = [assessed[k].name for k in found.order]
    places = zip(names, found.first_station, found.shift, strict=True)
    part.details["stitched"] = [
        {"photo": name, "first_station": first_station, f"s_{found.measurement.unit}": shift}
        for name, first_station, shift in places
    ]
    return AssessedPhoto(part, tables, pictures, whole, None, found.photo.name)


def inspect_photos(
    assessed: Sequence[AssessedPhoto], settings: InspectionSettings
) -> list[Inspected]:
    """All parts of all photos, in the order of the photos."""
    return [part for item in assessed for part in _inspected(item, settings)]


def _inspected(item: AssessedPhoto, settings: InspectionSettings) -> list[Inspected]:
    own: Inspected = (item.part, item.tables, item.pictures)
    result, bead = item.result, item.part
    if result is None:
        unjudged = [_unjudged(bead, settings.quality)] if settings.quality.asked else []
        return [own, *((part, {}, {}) for part in unjudged)]
    parts = [own]
    figures = {figure.name: figure for figure in bead.figures}
    if result.plane is not None:
        surface = surface_part(
            result.photo,
            result.plane,
            result.measurement,
            settings.before,
            bead.inputs,
            bead.index,
            bead.weld,
            settings.heights,
        )
        parts.append(surface)
        figures |= {figure.name: figure for figure in surface[0].figures}
    if settings.quality.asked:
        known = list(figures.values())
        judged = quality_part(result, known, settings.quality, bead.inputs, bead.index, bead.weld)
        parts.append((judged, {}, {}))
    return parts


def _unjudged(bead: Part, config: QualityConfig) -> Part:
    return Part(
        part="quality",
        index=bead.index,
        title=bead.title.replace("Bead width", "Quality"),
        weld=bead.weld,
        inputs=bead.inputs,
        configuration=config.model_dump(mode="json"),
        verdict=Verdict.NOT_MEASURABLE,
        reason=bead.reason,
    )
