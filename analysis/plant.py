"""What a plant is, and the one that fits an axis."""

from typing import Protocol

from seamlog.contracts import Axis

from .coulomb_plant import CoulombPlant
from .stribeck_plant import StribeckPlant


class Plant(Protocol):
    """An axis stepped by whole control periods."""

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later."""
        ...


def make_plant(axis: Axis, period_s: float) -> CoulombPlant | StribeckPlant:
    """The plant that fits `axis`: exact without Stribeck friction, sub-stepped with it."""
    if axis.stribeck_speed_m_s > 0.0 and axis.static_friction > axis.coulomb_friction:
        return StribeckPlant(axis, period_s)
    return CoulombPlant(axis, period_s)
