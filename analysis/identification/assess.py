"""Identification of a session: from its channels to the part of the results."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from seamlog.analysis.axis_record import AxisRecord, load_axis_record
from seamlog.analysis.live_controller import live_controller
from seamlog.analysis.part_tables import Tables
from seamlog.errors import EvidenceError
from seamlog.results import Part, input_of

from .compare import Comparison, Reference, compare
from .excitation import judge_excitation
from .gated import USUAL_DELAY
from .identify import Method, identify_axis
from .method import Friction
from .part import estimator_table, identification_part, refused_part

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld

ESTIMATOR = "/estimator/state"


@dataclass(frozen=True)
class IdentifyOptions:
    """How to identify, what to compare with (and its file name for the part's inputs)."""

    method: Method = "auto"
    friction: Friction = "symmetric"
    reference: Reference | None = None
    reference_file: Path | None = None


def identify_session(
    session: "Session", weld: "Weld | None" = None, options: IdentifyOptions | None = None
) -> tuple[Part, Tables]:
    """Part `identification` of a session, or of one weld of it; `EvidenceError` if it cannot tell.

    The motion of the whole session is used: an identification run before the arc is what tells
    most. With `weld` only the motion from arc on to arc off.
    """
    options = options or IdentifyOptions()
    record = load_axis_record(session)
    if weld is not None:
        record = record.between(weld.start_ns, weld.end_ns)
    delay, told = _delay(session)
    found, why = identify_axis(record, options.method, options.friction, delay)
    if found.method == "gated":
        why += f", delay {delay} periods {told}"
    rows: list[Comparison] = compare(found, options.reference) if options.reference else []
    files = [*session.paths, *([options.reference_file] if options.reference_file else [])]
    part, tables = identification_part(
        found, why, judge_excitation(found), rows, [input_of(path) for path in files]
    )
    return part, tables | _estimator(session, record)


def identify_or_refuse(session: "Session", weld: "Weld | None" = None) -> tuple[Part, Tables]:
    """As `identify_session`; where the session cannot tell, a part that says so."""
    try:
        return identify_session(session, weld)
    except EvidenceError as error:
        return refused_part(str(error), [input_of(path) for path in session.paths]), {}


def _delay(session: "Session") -> tuple[int, str]:
    live = live_controller(session.metadata, str(session.path))
    if live is None:
        return USUAL_DELAY, "assumed, the session does not tell"
    return live.axis.delay_periods, "as the session tells"


def _estimator(session: "Session", record: AxisRecord) -> Tables:
    if ESTIMATOR not in session.info.channels or not session.info.channels[ESTIMATOR].count:
        return {}
    return estimator_table(dict(session.columns(ESTIMATOR)), record.drive.unit)
