"""Identification of a session: from its channels to the part of the results."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from seamlog.analysis.axis_record import AxisRecord, load_axis_record
from seamlog.analysis.live_controller import live_controller
from seamlog.analysis.part_tables import Tables
from seamlog.errors import EvidenceError
from seamlog.results import Part, input_of

from .compare import Comparison, Reference, compare
from .excitation import judge_excitation
from .friction_models import Friction
from .gated import USUAL_DELAY
from .identify import identify_axis, select_axis_model
from .method import Identification, Method
from .part import Doubts, estimator_table, identification_part, refused_part
from .residuals import analyse_residual
from .selection import Selection
from .validation import validate

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld

ESTIMATOR = "/estimator/state"


@dataclass(frozen=True)
class IdentifyOptions:
    """How to identify, what to compare with (and its file name for the part's inputs).

    `friction` auto takes the model, and for fast records the lag, that cross-validation chooses.
    `validate` is another record of the same axis that the model has to predict.
    """

    method: Method = "auto"
    friction: Friction | Literal["auto"] = "symmetric"
    validate: AxisRecord | None = None
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
    found, why, selection = identify_record(record, options, delay)
    if found.method in ("gated", "batch"):
        why += f", delay {delay} periods {told}"
    rows: list[Comparison] = compare(found, options.reference) if options.reference else []
    files = [*session.paths, *([options.reference_file] if options.reference_file else [])]
    doubts = Doubts(judge_excitation(found), analyse_residual(found), selection)
    other = validate(found, options.validate) if options.validate else None
    part, tables = identification_part(
        found, why, doubts, rows, [input_of(path) for path in files], other
    )
    return part, tables | _estimator(session, record)


def identify_record(
    record: AxisRecord, options: IdentifyOptions, delay_periods: int
) -> tuple[Identification, str, Selection | None]:
    """Select the model where that is possible, then identify; also why this method was taken."""
    method, friction, lag = options.method, options.friction, 0.0
    try:
        selection = select_axis_model(record, delay_periods)
    except EvidenceError:
        if friction == "auto":
            raise
        selection = None
    if friction == "auto" and selection is not None:
        friction, lag = selection.chosen.friction, selection.chosen.lag_periods
    elif friction == "auto":
        friction = "symmetric"
    found, why = identify_axis(record, method, friction, delay_periods, lag)
    return found, why, selection


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
