"""Velocity by a Kalman filter of position, speed and acceleration, and by the smoother after it.

The acceleration is a random walk: its rate, the jerk, is white noise of density q [m^2/s^5]. The
gains are those of the steady state, so a missing position (NaN) is bridged by prediction. The
smoother is that of Rauch, Tung and Striebel (AIAA Journal 3 (1965) 1445-1450).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, optimize

from .difference import FloatArray

_DENSITIES = (1e-9, 1e4)


@dataclass(frozen=True)
class MotionModel:
    """Jerk density m^2/s^5, standard deviation of the measured position, sampling period."""

    jerk_density: float
    noise_m: float
    period_s: float

    @cached_property
    def transition(self) -> FloatArray:
        """Of (position, speed, acceleration) over one period, shape (3, 3)."""
        t = self.period_s
        return np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])

    @cached_property
    def predicted_covariance(self) -> FloatArray:
        """Of the state before its measurement, in the steady state, shape (3, 3)."""
        t, q = self.period_s, self.jerk_density
        scale = np.diag([1.0, 1.0 / t, 1.0 / t**2])
        unit = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
        drive = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
        relative = q * t**5 / self.noise_m**2
        steady = linalg.solve_discrete_are(
            unit.T, np.array([[1.0], [0.0], [0.0]]), relative * drive, np.array([[1.0]])
        )
        return np.asarray(self.noise_m**2 * (scale @ steady @ scale), dtype=np.float64)

    @property
    def innovation_variance(self) -> float:
        """Of measured - predicted position, m^2."""
        return float(self.predicted_covariance[0, 0]) + self.noise_m**2

    @property
    def gain(self) -> FloatArray:
        """What each m of innovation adds to the state, shape (3,)."""
        return self.predicted_covariance[:, 0] / self.innovation_variance

    @property
    def smoother_gain(self) -> FloatArray:
        """Of the Rauch-Tung-Striebel recursion, shape (3, 3)."""
        p = self.predicted_covariance
        filtered = p - np.outer(self.gain, p[0])
        return np.asarray(linalg.solve(p.T, self.transition @ filtered.T, assume_a="gen").T)


def kalman_states(position_m: FloatArray, model: MotionModel) -> tuple[FloatArray, FloatArray]:
    """Filtered states, shape (n, 3), and innovations, shape (n,), NaN where no position was."""
    t = model.period_s
    k0, k1, k2 = model.gain.tolist()
    measured = position_m.tolist()
    known = np.flatnonzero(np.isfinite(position_m))
    x, v, a = (measured[known[0]] if len(known) else 0.0), 0.0, 0.0
    if len(known) > 1 and known[1] == known[0] + 1:
        v = (measured[known[1]] - x) / t
    states, innovations = [], []
    for k, y in enumerate(measured):
        if k:
            x, v, a = x + t * (v + 0.5 * t * a), v + t * a, a
        innovation = y - x
        if innovation == innovation:
            x, v, a = x + k0 * innovation, v + k1 * innovation, a + k2 * innovation
        states.append((x, v, a))
        innovations.append(innovation)
    return np.array(states).reshape(-1, 3), np.array(innovations)


def kalman_velocity(position_m: FloatArray, model: MotionModel) -> FloatArray:
    """Causal velocity, shape (n,)."""
    return kalman_states(position_m, model)[0][:, 1]


def smoothed_velocity(position_m: FloatArray, model: MotionModel) -> FloatArray:
    """Velocity from past and future, shape (n,): for records only."""
    filtered, _ = kalman_states(position_m, model)
    predicted = filtered @ model.transition.T
    gain, states = model.smoother_gain, filtered.copy()
    for k in range(len(states) - 2, -1, -1):
        states[k] += gain @ (states[k + 1] - predicted[k])
    return states[:, 1]


def likeliest_model(position_m: FloatArray, period_s: float, noise_m: float) -> MotionModel:
    """The jerk density under which the innovations are likeliest, `noise_m` being known."""

    def unlikely(log_density: float) -> float:
        model = MotionModel(float(np.exp(log_density)), noise_m, period_s)
        innovations = kalman_states(position_m, model)[1][20:]
        innovations = innovations[np.isfinite(innovations)]
        variance = model.innovation_variance
        return float(np.log(variance) + np.mean(innovations**2) / variance)

    low, high = np.log(_DENSITIES)
    best = optimize.minimize_scalar(
        unlikely, bounds=(low, high), method="bounded", options={"xatol": 0.1}
    )
    return MotionModel(float(np.exp(best.x)), noise_m, period_s)


def encoder_noise_m(position_m: FloatArray) -> float:
    """Standard deviation of rounding to the encoder's step: the least distance of two positions."""
    places = np.unique(position_m[np.isfinite(position_m)])
    steps = np.diff(places)
    steps = steps[steps > 1e-12]
    return max(float(steps.min()) / np.sqrt(12.0), 1e-9) if len(steps) else 1e-9
