"""Measured photos to parts: bead, surface and, where limits were given, quality."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from seamlog.results import Figure, Part, Verdict

from .bead.assess import AssessedPhoto
from .bead.image import Photo
from .bead.part import Pictures, Tables
from .quality.part import QualityConfig, quality_part
from .surface.part import surface_part

Inspected = tuple[Part, Tables, Pictures]


@dataclass(frozen=True, slots=True)
class InspectionSettings:
    """What photos are inspected for: limits, and a photo from before welding to compare with."""

    quality: QualityConfig = field(default_factory=QualityConfig)
    before: Photo | None = None
    heights: tuple[Figure, ...] = ()
    """Figures of a laser stripe, where the log has one."""


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
