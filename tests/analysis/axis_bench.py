"""The axis bench: the reference axis, its references and its noise."""

import numpy as np

from seamlog.analysis.closed_loop import Reference
from seamlog.contracts import Axis

PERIOD_S = 0.04
COUNT = 1500
ENCODER_STEP_M = 1e-6
SPEED_NOISE_M_S = 5e-4
AXIS = Axis(
    inertia=1.0,
    viscous_friction=2.14,
    coulomb_friction=0.214,
    static_friction=0.257,
    stribeck_speed_m_s=0.002,
    saturation=20.0,
)
COULOMB_AXIS = Axis(1.0, 2.14, 0.214, saturation=20.0)


def sine(amplitude_m: float, rate_rad_s: float, count: int = COUNT) -> Reference:
    angle = rate_rad_s * PERIOD_S * np.arange(count)
    return Reference(
        amplitude_m * np.sin(angle),
        amplitude_m * rate_rad_s * np.cos(angle),
        -amplitude_m * rate_rad_s**2 * np.sin(angle),
    )


def speed_noise(seed: int, count: int = COUNT) -> np.ndarray:
    return SPEED_NOISE_M_S * np.random.default_rng(seed).standard_normal(count)
