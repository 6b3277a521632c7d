"""A session to parts of results: health, tracking, identification, seam, bead, join."""

from collections.abc import Mapping, Sequence
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
from .seam_part import seam_part
from .tracking import TrackingLimits, tracking_parts, unknown_tracking
from .welds import chosen_welds

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld

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
    assessed: list[Assessed] = [(part, tables, {}) for part, tables in log]
    return [*assessed, seam_part(session, welds), *_beads(session, options, welds)]


def _beads(session: "Session", options: AnalyzeOptions, welds: "Sequence[Weld]") -> list[Assessed]:
    """Bead and join of the photos given or attached; what cannot be measured says why."""
    from .bead_assess import bead_and_join

    found = bead_and_join(
        session, welds, options.photos, options.start, options.config, options.settings
    )
    return [(part, tables, pictures) for part, tables, pictures in found]
