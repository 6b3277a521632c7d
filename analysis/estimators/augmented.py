"""The axis with its parameters as states, for the nonlinear Kalman filters.

State (x, v, p, q, r): position, speed, and p = 1/a, q = b/a, r = C/a, in which

    dv/dt = p u - q v - r s

is linear, so that nothing has to be known at the start: zero says that no force moves the axis.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

FloatArray = NDArray[np.float64]


class AugmentedConfig(BaseModel):
    """Noise of the axis and of its measurement; the share of the parameters is their own."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    gate_m_s: float = Field(0.005, ge=0)
    """Periods with a slower end teach nothing about the parameters."""
    position_noise_m: float = Field(3e-7, gt=0)
    speed_noise_m_s: float = Field(5e-4, gt=0)
    acceleration_noise_m_s2: float = Field(2e-3, gt=0)
    """Standard deviation of what the model lacks, mean over a period."""
    initial_acceleration_per_command: float = Field(1.0, gt=0)
    """Largest 1/a to expect, (m/s^2) per command unit: its standard deviation at the start."""
    initial_rate_1_s: float = Field(10.0, gt=0)
    """Standard deviation of b/a at the start."""
    initial_deceleration_m_s2: float = Field(2.0, gt=0)
    """Standard deviation of C/a at the start."""


@dataclass(frozen=True)
class Belief:
    """Mean, shape (5,), and covariance, shape (5, 5), of the state."""

    mean: FloatArray
    covariance: FloatArray


def first_belief(config: AugmentedConfig, position_m: float, velocity_m_s: float) -> Belief:
    """Before anything moved: parameters 0 with their wide deviations."""
    spread = (
        config.position_noise_m,
        config.speed_noise_m_s,
        config.initial_acceleration_per_command,
        config.initial_rate_1_s,
        config.initial_deceleration_m_s2,
    )
    mean = np.array([position_m, velocity_m_s, 0.0, 0.0, 0.0])
    return Belief(mean, np.diag(np.square(spread)))


def advance(state: FloatArray, direction: float, command: float, period_s: float) -> FloatArray:
    """States one period later under a constant command while sliding, shape (5,) or (5, n)."""
    x, v, p, q, r = state
    rate = p * command - q * v - r * direction
    decay = np.clip(q * period_s, -1.0, 5.0)
    gained = rate * period_s * (1.0 - decay / 2.0 + decay**2 / 6.0 - decay**3 / 24.0)
    travel = period_s * (v + rate * period_s * (0.5 - decay / 6.0 + decay**2 / 24.0))
    return np.asarray([x + travel, v + gained, p, q, r], dtype=np.float64)


def process_noise(config: AugmentedConfig, period_s: float) -> FloatArray:
    """Of position and speed over one period, shape (5, 5)."""
    kick = config.acceleration_noise_m_s2 * period_s
    return np.diag([(0.5 * kick * period_s) ** 2, kick * kick, 0.0, 0.0, 0.0])


def measured(belief: Belief, seen: tuple[float, float], config: AugmentedConfig) -> Belief:
    """The belief after position and speed were seen; NaN in either: as before."""
    innovation = np.array(seen) - belief.mean[:2]
    if not np.isfinite(innovation).all():
        return belief
    noise = np.diag([config.position_noise_m**2, config.speed_noise_m_s**2])
    cross = belief.covariance[:, :2]
    gain = cross @ np.linalg.inv(belief.covariance[:2, :2] + noise)
    covariance = belief.covariance - gain @ cross.T
    return Belief(belief.mean + gain @ innovation, 0.5 * (covariance + covariance.T))


def restarted(belief: Belief, seen: tuple[float, float], config: AugmentedConfig) -> Belief:
    """Motion as it is seen, parameters as they were: across periods that teach nothing."""
    mean, covariance = belief.mean.copy(), belief.covariance.copy()
    if np.isfinite(seen).all():
        mean[:2] = seen
    covariance[:2, :] = covariance[:, :2] = 0.0
    covariance[0, 0], covariance[1, 1] = config.position_noise_m**2, config.speed_noise_m_s**2
    return Belief(mean, covariance)


def physical_parameters(belief: Belief) -> tuple[float, float, float]:
    """inertia, viscous and Coulomb friction; 0 while 1/a is not known to be above 0."""
    _, _, p, q, r = belief.mean.tolist()
    if p * p <= belief.covariance[2, 2] or p <= 0.0:
        return 0.0, 0.0, 0.0
    return 1.0 / p, q / p, r / p


def physical_variances(belief: Belief) -> tuple[float, float, float]:
    """Variances of the three by linear propagation; NaN while they are unknown."""
    _, _, p, q, r = belief.mean.tolist()
    if p * p <= belief.covariance[2, 2] or p <= 0.0:
        return math.nan, math.nan, math.nan
    slope = np.array([[-1.0, 0.0, 0.0], [-q, p, 0.0], [-r, 0.0, p]]) / p**2
    found = np.diag(slope @ belief.covariance[2:, 2:] @ slope.T)
    return float(found[0]), float(found[1]), float(found[2])
