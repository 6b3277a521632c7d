"""The live loop: points of the camera to a path, path to a reference, reference to a command.

camera points -> B-spline path -> x_d, v_d, a_d -> adaptive sliding-mode law -> command
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.controllers.adaptive import AdaptiveConfig, AdaptiveController
from seamlog.analysis.controllers.inner import InnerEstimator
from seamlog.analysis.controllers.paper import PaperConfig

from .path_fit import SeamPath
from .rig import NOMINAL_AXIS, PERIOD_S
from .schedule import RETURN_S
from .view import MM_FROM_PX, project

Floats = NDArray[np.float64]

CONTROLLER = AdaptiveConfig(
    law=PaperConfig(
        surface_slope=4.0,
        gain=9.0,
        boundary_layer=0.12,
        dead_zone_m_s=0.0001,
        friction_speed="reference",
    ),
    estimator=InnerEstimator(
        name="gated_rls",
        config={
            "initial_inertia": NOMINAL_AXIS.inertia,
            "initial_viscous_friction": NOMINAL_AXIS.viscous_friction,
            "initial_coulomb_friction": NOMINAL_AXIS.coulomb_friction,
        },
    ),
    adapt_after_s=5.0,
)
"""Friction is taken at the reference speed: along a seam the table moves at a few mm/s, inside
the dead zone that the paper's measured speed would need, and the comparison would be lost."""
_AMPLITUDE_M = 0.1
_WATCH_S = 4.0
"""The camera's points count from this long before the end of the identification."""
_REFIT_FRAMES = 5


@dataclass(frozen=True, slots=True)
class LoopStep:
    """What one period of the loop decided."""

    reference: tuple[float, float, float]
    """m, m/s, m/s^2."""
    command: float
    saturated: bool


class TorchTracker:
    """Where the torch is along the robot's travel, from its marker: an alpha-beta filter."""

    _POSITION_GAIN, _SPEED_GAIN = 0.35, 0.07

    def __init__(self) -> None:
        self._time_s, self._y_mm, self._speed_mm_s = math.nan, 0.0, 0.0

    def take(self, time_s: float, y_mm: float) -> None:
        """A marker seen at `time_s`."""
        step_s = time_s - self._time_s
        if math.isnan(step_s):
            self._time_s, self._y_mm = time_s, y_mm
            return
        expected_mm = self._y_mm + step_s * self._speed_mm_s
        self._y_mm = expected_mm + self._POSITION_GAIN * (y_mm - expected_mm)
        self._speed_mm_s += self._SPEED_GAIN / step_s * (y_mm - expected_mm)
        self._time_s = time_s

    def at(self, time_s: float) -> tuple[float, float]:
        """Position and speed, mm and mm/s."""
        return self._y_mm + (time_s - self._time_s) * self._speed_mm_s, self._speed_mm_s


class LiveLoop:
    """The program on the cell's computer."""

    def __init__(self, identification_s: float) -> None:
        self.controller = AdaptiveController(CONTROLLER, NOMINAL_AXIS, PERIOD_S)
        self.path = SeamPath()
        self._tracker = TorchTracker()
        self._identification_s = identification_s
        self._samples: list[tuple[float, float]] = []
        self._frames = 0
        self._reference = (0.0, 0.0, 0.0)
        self._start: tuple[float, tuple[float, float, float], float] | None = None

    def see(
        self, time_s: float, points_px: tuple[Floats, Floats], marker_px: tuple[float, float]
    ) -> bool:
        """Take what was found in the picture exposed at `time_s`; True if the path is new."""
        self._tracker.take(time_s, float(project(MM_FROM_PX, marker_px)[0, 1]))
        if time_s < self._identification_s - _WATCH_S:
            return False
        fixed_mm = project(MM_FROM_PX, np.column_stack(points_px))
        self.path.add(fixed_mm[:, 0] - 1e3 * self._table_m(time_s), fixed_mm[:, 1])
        self._frames += 1
        return self._frames % _REFIT_FRAMES == 0 and self.path.fit()

    def _table_m(self, time_s: float) -> float:
        times, positions = zip(*self._samples, strict=True)
        return float(np.interp(time_s, times, positions))

    def step(self, time_s: float, position_m: float, velocity_m_s: float) -> LoopStep:
        """One period: reference, estimate, command."""
        self._samples = [*self._samples[-9:], (time_s, position_m)]
        reference = self._reference = self._next_reference(time_s)
        wanted = self.controller.output(*reference, position_m, velocity_m_s)
        limit = NOMINAL_AXIS.saturation
        command = min(max(wanted, -limit), limit)
        return LoopStep(reference, command, command != wanted)

    def _next_reference(self, time_s: float) -> tuple[float, float, float]:
        if time_s < self._identification_s or not self.path.is_known:
            sine, cosine = math.sin(time_s), math.cos(time_s)
            return _AMPLITUDE_M * sine, _AMPLITUDE_M * cosine, -_AMPLITUDE_M * sine
        if self._start is None:
            y_mm, _ = self._tracker.at(time_s)
            self._start = (time_s, self._reference, -1e-3 * self.path.at(y_mm)[0])
        since_s = time_s - self._start[0]
        if since_s < RETURN_S:
            return _soft_move(self._start[1], self._start[2], RETURN_S, since_s)
        return self._along_seam(time_s)

    def _along_seam(self, time_s: float) -> tuple[float, float, float]:
        y_mm, speed_mm_s = self._tracker.at(time_s)
        x_mm, slope, bend = self.path.at(y_mm)
        return -1e-3 * x_mm, -1e-3 * slope * speed_mm_s, -1e-3 * bend * speed_mm_s * speed_mm_s


def _soft_move(
    start: tuple[float, float, float], end_m: float, duration_s: float, time_s: float
) -> tuple[float, float, float]:
    """Quintic from a motion (position, velocity, acceleration) to rest at `end_m`."""
    tau, total = time_s, duration_s
    x, v, a = start
    gap = end_m - x
    c3 = 10.0 * gap / total**3 - 6.0 * v / total**2 - 1.5 * a / total
    c4 = -15.0 * gap / total**4 + 8.0 * v / total**3 + 1.5 * a / total**2
    c5 = 6.0 * gap / total**5 - 3.0 * v / total**4 - 0.5 * a / total**3
    return (
        x + tau * (v + tau * (0.5 * a + tau * (c3 + tau * (c4 + tau * c5)))),
        v + tau * (a + tau * (3.0 * c3 + tau * (4.0 * c4 + tau * 5.0 * c5))),
        a + tau * (6.0 * c3 + tau * (12.0 * c4 + tau * 20.0 * c5)),
    )
