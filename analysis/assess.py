"""A whole session to parts of results: health, tracking, identification, bead."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from seamlog.config import load_config
from seamlog.errors import ChannelMissing
from seamlog.results import Columns, Part, Picture, input_of

from .axis_record import COMMAND, ENCODER
from .health import health_part
from .identification.assess import identify_or_refuse
from .identification.part import refused_part
from .tracking import TrackingLimits, tracking_parts, unknown_tracking
from .welds import chosen_welds

if TYPE_CHECKING:
    from seamlog.session import Session

Assessed = tuple[
    Part,
    Mapping[str, tuple[Columns, Mapping[str, str]]],
    Mapping[str, tuple[bytes, Picture]],
]
"""A part, its tables (columns and their units) and its pictures."""


@dataclass(frozen=True)
class AnalyzeOptions:
    """What `analyze` was asked: photos (none: those attached), weld (None: each), configuration."""

    photos: tuple[Path, ...] = ()
    weld: int | None = None
    start: str | None = None
    config: Path | None = None
    settings: tuple[str, ...] = ()


def assess_session(session: "Session", options: AnalyzeOptions) -> list[Assessed]:
    """All parts of one session, each with its tables and pictures."""
    limits = load_config(TrackingLimits, "limits", options.config, options.settings)
    welds = chosen_welds(session, options.weld)
    log = [health_part(session)]
    try:
        log += tracking_parts(session, welds, limits)
        log.append(identify_or_refuse(session))
    except ChannelMissing as error:
        inputs = [input_of(path) for path in session.paths]
        reason = f"no control loop was recorded ({ENCODER}, {COMMAND}): {error}"
        log += [(unknown_tracking(reason, inputs), {}), (refused_part(reason, inputs), {})]
    beads = _beads(session, options, welds[0].number if len(welds) == 1 else None)
    return [*((part, tables, {}) for part, tables in log), *beads]


def _beads(session: "Session", options: AnalyzeOptions, weld: int | None) -> list[Assessed]:
    """Parts of the photos given or attached; a photo that cannot be measured says why."""
    from .bead.assess import assess_photos
    from .bead.part import BeadConfig
    from .bead.sources import attached_photos, photo_files

    config = load_config(BeadConfig, "bead", options.config, options.settings)
    photos = photo_files(options.photos, None) if options.photos else attached_photos(session)
    found = assess_photos(photos, options.start, config, weld)
    return [(photo.part, photo.tables, photo.pictures) for photo in found]
