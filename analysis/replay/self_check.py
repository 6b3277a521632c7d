"""Whether the replay reproduces what was recorded; everything else rests on that."""

from dataclasses import dataclass

import numpy as np

from seamlog.analysis.axis_record import AxisRecord
from seamlog.analysis.live_controller import LiveController
from seamlog.contracts import Axis
from seamlog.errors import UnknownName, UsageError

from .abduction import abduce, reproduce
from .factories import ControllerChoice, choose_controller
from .shadow import shadow_controller


@dataclass(frozen=True)
class SelfCheck:
    """Largest differences between recorded and reproduced values; None if not known (`reason`).

    `shadow_difference`: recorded controller on the recorded measurements. `command_difference`,
    `position_difference_m`: recorded controller in closed loop with the abduced disturbance.
    """

    shadow_difference: float | None = None
    command_difference: float | None = None
    position_difference_m: float | None = None
    reason: str = ""


def recorded_choice(live: LiveController | None) -> tuple[ControllerChoice | None, str]:
    """The recorded controller as it ran, or the reason why it cannot be made again."""
    if live is None:
        return None, (
            "the session does not say which controller was live (metadata record "
            "seamlog.controller): its commands cannot be recomputed"
        )
    try:
        return choose_controller(live.name, live.config), ""
    except (UnknownName, UsageError) as error:
        return None, f"the recorded controller {live.name!r} cannot be made again: {error}"


def check_replay(record: AxisRecord, live: LiveController | None, axis: Axis | None) -> SelfCheck:
    """Run the recorded controller again; `axis` is the identified one, None if there is none."""
    choice, reason = recorded_choice(live)
    if choice is None or live is None:
        return SelfCheck(reason=reason)
    period_s = record.period_s
    shadow = shadow_controller(choice.make(live.axis, period_s), record, live.axis.saturation)
    shadow_difference = float(np.max(np.abs(shadow.command - record.command)))
    if axis is None:
        return SelfCheck(shadow_difference, reason="no axis model: no closed loop to check")
    run = reproduce(abduce(record, axis), record, axis, choice.make(live.axis, period_s))
    return SelfCheck(
        shadow_difference,
        float(np.max(np.abs(run.command - record.command))),
        float(np.max(np.abs(run.measured_position_m - record.position_m))),
    )
