"""Whether the recorded controller, fed the record, gives the recorded commands: channel by channel.

A value counts as reproduced if it lies within absolute + relative tolerance of the recorded one,
or of one recorded within the time tolerance. Periods that were filled, and a while after them, in
which the controller still remembers them, are left out and counted.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import COMMAND, AxisRecord, FloatArray
from seamlog.analysis.live_controller import LiveController

from .inputs import ReplayInputs
from .self_check import recorded_choice
from .settings import CheckSettings
from .shadow import ShadowOutput, shadow_controller

if TYPE_CHECKING:
    from seamlog.session import Session

STATE = "/controller/state"
MOST_EXCLUDED = 0.2
"""Largest share of the periods that may be left out of the check."""


@dataclass(frozen=True)
class Difference:
    """One channel's field: periods compared, those that differ, the largest difference.

    `first_ns` is the log time of the first that differs; `tolerance` is in the field's own unit.
    """

    name: str
    unit: str
    compared: int
    different: int
    largest: float
    tolerance: float
    first_ns: int | None


@dataclass(frozen=True)
class OriginalCheck:
    """`engaged` and `differences` decide; `reason` says why nothing could be compared."""

    differences: tuple[Difference, ...] = ()
    excluded: int = 0
    engaged: bool = True
    reason: str = ""

    @property
    def holds(self) -> bool | None:
        """Whether the original was reproduced; None where that cannot be known."""
        if not self.engaged:
            return False
        if self.reason:
            return None
        return not any(row.different for row in self.differences)


def check_session(
    session: "Session", inputs: ReplayInputs, live: LiveController | None, settings: CheckSettings
) -> OriginalCheck:
    """`check_original` with the states that `session` recorded, if any."""
    states: dict[str, FloatArray] = {}
    if STATE in session.info.channels:
        metadata = session.channel_metadata(STATE)
        states = recorded_states(session.columns(STATE), metadata, inputs.record)
    return check_original(inputs, live, states, settings)


def check_original(
    inputs: ReplayInputs,
    live: LiveController | None,
    states: Mapping[str, FloatArray],
    settings: CheckSettings,
) -> OriginalCheck:
    """Run the recorded controller on the record; `states` are recorded ones, one value per row."""
    record = inputs.record
    choice, reason = recorded_choice(live)
    if choice is None or live is None:
        return OriginalCheck(reason=reason)
    idle = _idle(record)
    if idle:
        return OriginalCheck(engaged=False, reason=idle)
    counted = _counted(inputs, settings)
    excluded = int(np.sum(~counted))
    if excluded > MOST_EXCLUDED * len(record):
        told = (
            f"{excluded} of {len(record)} control periods would have to be left out because of "
            f"holes, more than {100 * MOST_EXCLUDED:.0f} %"
        )
        return OriginalCheck(excluded=excluded, reason=told)
    controller = choice.make(live.axis, record.period_s)
    output = shadow_controller(controller, record, live.axis.saturation)
    rows = _compared(record, output, tuple(controller.state_names), states, settings, counted)
    return OriginalCheck(tuple(rows), excluded)


def recorded_states(
    columns: Mapping[str, NDArray[Any]], metadata: Mapping[str, str], record: AxisRecord
) -> dict[str, FloatArray]:
    """`/controller/state` by name on the rows of `record`, NaN where none was logged in time."""
    times = columns["log_time_ns"]
    if not len(times):
        return {}
    right = np.clip(np.searchsorted(times, record.log_time_ns), 0, len(times) - 1)
    left = np.maximum(right - 1, 0)
    ahead = np.abs(times[right] - record.log_time_ns)
    behind = np.abs(times[left] - record.log_time_ns)
    nearest = np.where(behind < ahead, left, right)
    close = np.minimum(ahead, behind) < 0.5e9 * record.period_s
    values = np.stack(list(columns["values"])).astype(np.float64)[nearest]
    names = json.loads(metadata.get("names", "[]"))
    return {name: np.where(close, values[:, place], np.nan) for place, name in enumerate(names)}


def _idle(record: AxisRecord) -> str:
    """Why the record shows no controller at work; empty if it does."""
    if not np.any(record.command != record.command[0]):
        return f"the command never changes ({record.command[0]:g}): no controller was engaged"
    if record.saturated.all():
        return "every command was at its limit: the record does not show what the controller said"
    return ""


def _counted(inputs: ReplayInputs, settings: CheckSettings) -> NDArray[np.bool_]:
    """Rows that are neither filled nor soon after a filled one."""
    after = max(1, round(settings.settle_s / inputs.record.period_s))
    since = np.convolve(inputs.filled, np.ones(after + 1))[: len(inputs.filled)]
    return np.asarray(since == 0)


def _compared(
    record: AxisRecord,
    output: ShadowOutput,
    names: tuple[str, ...],
    states: Mapping[str, FloatArray],
    settings: CheckSettings,
    counted: NDArray[np.bool_],
) -> Iterator[Difference]:
    unit = record.drive.unit
    yield _difference(
        f"{COMMAND}.command", unit, record.command, output.command, record, settings, counted
    )
    for place, name in enumerate(names):
        if name not in states:
            continue
        told = f"{STATE}.{name}"
        values = output.states[:, place]
        yield _difference(told, "", states[name], values, record, settings, counted)


def _difference(
    name: str,
    unit: str,
    recorded: FloatArray,
    replayed: FloatArray,
    record: AxisRecord,
    settings: CheckSettings,
    counted: NDArray[np.bool_],
) -> Difference:
    rows = counted & np.isfinite(recorded)
    tolerance = settings.absolute + settings.relative * float(
        np.max(np.abs(recorded[rows]), initial=0.0)
    )
    apart = _apart(recorded, replayed, round(settings.time_s / record.period_s))[rows]
    wrong = ~(apart <= tolerance)
    first = np.flatnonzero(wrong)
    return Difference(
        name=name,
        unit=unit,
        compared=int(rows.sum()),
        different=int(wrong.sum()),
        largest=float(np.max(apart, initial=0.0)),
        tolerance=tolerance,
        first_ns=int(record.log_time_ns[rows][first[0]]) if len(first) else None,
    )


def _apart(recorded: FloatArray, replayed: FloatArray, periods: int) -> FloatArray:
    """Distance to the nearest value replayed within `periods` to either side."""
    least = np.abs(recorded - replayed)
    for shift in range(1, min(periods, len(replayed) - 1) + 1):
        least[shift:] = np.fmin(least[shift:], np.abs(recorded[shift:] - replayed[:-shift]))
        least[:-shift] = np.fmin(least[:-shift], np.abs(recorded[:-shift] - replayed[shift:]))
    return least
