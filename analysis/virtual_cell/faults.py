"""What goes wrong on request."""

from .schedule import Schedule

CLOCK_STEP_S = 0.35
SLIP_MM = 2.0
_GAPS_S = ((6.0, 6.3), (13.0, 13.2), (31.0, 31.8))
"""Times without encoder messages and pictures."""


class Faults:
    """The chosen faults along one run."""

    def __init__(self, names: tuple[str, ...], schedule: Schedule) -> None:
        self._names = frozenset(names)
        middle_s = schedule.arc_on_s + 0.35 * (schedule.arc_off_s - schedule.arc_on_s)
        self._middle_s = round(middle_s, 2)

    def loses(self, time_s: float) -> bool:
        """Whether a message of this time gets lost."""
        return "dropouts" in self._names and any(a <= time_s < b for a, b in _GAPS_S)

    def camera_stamp_s(self, time_s: float) -> float:
        """What the camera's clock says."""
        return time_s + (CLOCK_STEP_S if self._is_after("clock_step", time_s) else 0.0)

    def clock_stepped_s(self) -> float | None:
        """When the camera's clock stepped."""
        return self._middle_s if "clock_step" in self._names else None

    def slip_mm(self, time_s: float) -> float:
        """How far the plate has slipped on the table."""
        return SLIP_MM if self._is_after("seam_jump", time_s) else 0.0

    def _is_after(self, name: str, time_s: float) -> bool:
        return name in self._names and time_s >= self._middle_s
