"""Bead and join as parts of a session's results: photos measured, then tied to its welds."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from seamlog.config import load_config
from seamlog.results import Input, Part, input_of

from .bead.assess import AssessedPhoto, assess_photos
from .bead.part import BeadConfig, Pictures, Tables
from .bead.sources import attached_photos, frame_before, logged_seam_mm, photo_files
from .inspection import InspectionSettings, inspect_photos, stitched
from .join_part import join_part, no_join
from .quality.part import QualityConfig
from .surface.heights import heights_of, heights_part

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld


def bead_and_join(
    session: "Session",
    welds: Sequence["Weld"],
    photos: tuple[Path, ...] = (),
    start: str | None = None,
    config: Path | None = None,
    settings: tuple[str, ...] = (),
) -> list[tuple[Part, Tables, Pictures]]:
    """Parts `bead`, `surface`, `quality` of each photo, `profile` and `join` of each weld.

    Without `photos` those attached to the session are taken. With as many photos as welds each
    belongs to the weld of its number; else all of them to the only weld.
    """
    settled = load_config(BeadConfig, "bead", config, settings)
    quality = load_config(QualityConfig, "quality", config, settings)
    sources = photo_files(photos, None) if photos else attached_photos(session)
    spans: Sequence[Weld | None] = welds or [None]
    profiles = [found for weld in spans if (found := heights_part(session, weld))]
    if not sources:
        return profiles
    only = welds[0].number if len(welds) == 1 else None
    assessed = assess_photos(sources, start, settled, only, logged_seam_mm(session))
    inputs = [input_of(path) for path in session.paths]
    whole = stitched(assessed, settled) if len(welds) == 1 else ""
    if isinstance(whole, AssessedPhoto):
        assessed = [*assessed, whole]
    heights = heights_of(profiles[0][0]) if len(profiles) == 1 else ()
    before = frame_before(session, welds[0].start_ns) if welds else None
    parts = [*inspect_photos(assessed, InspectionSettings(quality, before, heights)), *profiles]
    if not welds:
        return [*parts, (no_join("the session has no weld", None, inputs), {}, {})]
    for index, weld in enumerate(welds):
        parts.append((*_joined(session, weld, index, len(welds), assessed, settled, inputs), {}))
    return parts


def _joined(
    session: "Session",
    weld: "Weld",
    index: int,
    count: int,
    assessed: Sequence[AssessedPhoto],
    config: BeadConfig,
    inputs: list[Input],
) -> tuple[Part, Tables]:
    if count not in (1, len(assessed)):
        reason = f"{len(assessed)} photos for {count} welds: say with --weld which one they show"
        return no_join(reason, weld, inputs), {}
    chosen = assessed if count == 1 else assessed[index : index + 1]
    measured = [item.result for item in chosen if item.result is not None]
    if not measured:
        return no_join(f"no width was measured: {chosen[0].refusal}", weld, inputs), {}
    whole = measured[-1] if measured[-1].plane is None else measured[0]
    return join_part(session, weld, whole.measurement, config, inputs, whole.plane)
