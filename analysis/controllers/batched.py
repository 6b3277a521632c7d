"""The paper's law and PID for many configurations at once, for sweeps and ensembles.

They say what the scalar controllers say, to rounding: numpy's arctangent is not the scalar one.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.dynamics import backward_axis
from seamlog.contracts import Axis

from .paper import PaperConfig
from .pid import PIDConfig, integral_bound

Floats = NDArray[np.float64]


class BatchedPaper:
    """Eq. 12 for each pair of configuration and axis; see `PaperController`."""

    def __init__(self, configs: Sequence[PaperConfig], axes: Sequence[Axis]) -> None:
        self._inertia = np.array([axis.inertia for axis in axes])
        self._viscous = np.array([axis.viscous_friction for axis in axes])
        self._coulomb = np.array([axis.coulomb_friction for axis in axes])
        static = [max(axis.static_friction, axis.coulomb_friction) for axis in axes]
        gains = [f if c.gain is None else c.gain for c, f in zip(configs, static, strict=True)]
        rates = np.array([config.reach_rate for config in configs])
        self._switching = self._inertia * rates + np.array(gains)
        self._slope = np.array([config.surface_slope for config in configs])
        twice = np.array([2.0 if config.form == "right" else 1.0 for config in configs])
        self._damping, self._stiffness = twice * self._slope, self._slope * self._slope
        self._layer = np.array([config.boundary_layer for config in configs])
        self._dead_zone_m_s = np.array([config.dead_zone_m_s for config in configs])
        self._on_reference = np.array([c.friction_speed == "reference" for c in configs])

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: Floats,
        velocity_m_s: Floats,
    ) -> Floats:
        """Commands before saturation, shape (configurations,)."""
        error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
        speed = np.where(self._on_reference, reference_m_s, velocity_m_s)
        friction = self._viscous * speed + self._coulomb * shape(speed / self._dead_zone_m_s)
        wanted_m_s2 = reference_m_s2 + self._damping * error_m_s + self._stiffness * error_m
        ratio = (error_m_s + self._slope * error_m) / self._layer
        switching = self._switching * np.minimum(np.maximum(ratio, -1.0), 1.0)
        return np.asarray(friction + self._inertia * wanted_m_s2 + switching)


class BatchedPID:
    """PID for each pair of configuration and axis, PD where ki is 0; see `PID`."""

    def __init__(self, configs: Sequence[PIDConfig], axes: Sequence[Axis], period_s: float) -> None:
        self._inertia = np.array([axis.inertia for axis in axes])
        sides = (axes, [backward_axis(axis) for axis in axes])
        self._viscous = [np.array([axis.viscous_friction for axis in side]) for side in sides]
        self._coulomb = [np.array([axis.coulomb_friction for axis in side]) for side in sides]
        self._offset = np.array([axis.offset for axis in axes])
        self._kp = self._gain([config.kp for config in configs], 16.0)
        self._ki = self._gain([config.ki for config in configs], 8.0) * period_s
        self._kd = self._gain([config.kd for config in configs], 8.0)
        self._known = np.array([1.0 if config.feed_forward else 0.0 for config in configs])
        self._dead_zone_m_s = np.array([config.dead_zone_m_s for config in configs])
        pairs = zip(configs, axes, strict=True)
        self._bound = np.array([c.integral_limit or integral_bound(axis) for c, axis in pairs])
        self._integral = np.zeros(len(configs))

    def _gain(self, values: list[float | None], usual: float) -> Floats:
        return np.array(
            [usual * a if v is None else v for v, a in zip(values, self._inertia, strict=True)]
        )

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: Floats,
        velocity_m_s: Floats,
    ) -> Floats:
        """Commands before saturation, shape (configurations,)."""
        error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
        integral = self._integral + self._ki * error_m
        self._integral = np.minimum(np.maximum(integral, -self._bound), self._bound)
        side = 1 if reference_m_s < 0.0 else 0
        known = self._inertia * reference_m_s2 + self._viscous[side] * reference_m_s + self._offset
        known += self._coulomb[side] * shape(reference_m_s / self._dead_zone_m_s)
        feedback = self._kp * error_m + self._kd * error_m_s
        return np.asarray(feedback + self._integral + self._known * known)


def shape(ratio: Floats) -> Floats:
    """Eq. 3 of speed over dead zone: (2/pi) atan(ratio^9)."""
    cube = ratio * ratio * ratio
    return np.asarray(2.0 / np.pi * np.arctan(cube * cube * cube))
