"""The table of the virtual cell: plant with Stribeck friction and screw ripple, encoder, delay."""

import math

import numpy as np

from seamlog.analysis.stribeck_plant import Ripple, StribeckPlant
from seamlog.contracts import Axis

from .schedule import TICK_S

PERIOD_S = 0.04
TRUE_AXIS = Axis(
    inertia=42.0,
    viscous_friction=90.0,
    coulomb_friction=6.0,
    static_friction=6.6,
    stribeck_speed_m_s=0.002,
    saturation=300.0,
    delay_periods=1,
    unit="N",
)
"""The plant's truth: forces in N at the table."""
NOMINAL_AXIS = Axis(
    inertia=48.0,
    viscous_friction=72.0,
    coulomb_friction=7.5,
    static_friction=9.0,
    stribeck_speed_m_s=0.002,
    saturation=300.0,
    delay_periods=1,
    unit="N",
)
"""What the live loop believes before it has identified anything."""
RIPPLE = Ripple(amplitude=0.12, pitch_m=0.010)
ENCODER_STEP_M = 1e-6
SPEED_NOISE_M_S = 5e-4


class Table:
    """The moving table: `position_m` and `velocity_m_s` are the truth."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._plant = StribeckPlant(TRUE_AXIS, TICK_S, ripple=RIPPLE)
        self._waiting = [0.0] * (TRUE_AXIS.delay_periods + 1)
        self.position_m = 0.0
        self.velocity_m_s = 0.0

    def measure(self) -> tuple[float, float]:
        """Position and velocity as the encoder gives them."""
        position_m = math.floor(self.position_m / ENCODER_STEP_M + 0.5) * ENCODER_STEP_M
        return position_m, self.velocity_m_s + SPEED_NOISE_M_S * float(self._rng.standard_normal())

    def send(self, command: float) -> None:
        """Begin a new control period; `command` (already limited) acts after the delay."""
        self._waiting.append(command)
        self._waiting.pop(0)

    def tick(self) -> None:
        """Move by one tick of TICK_S."""
        self.position_m, self.velocity_m_s = self._plant.step(
            self.position_m, self.velocity_m_s, self._waiting[0]
        )
