"""Kalman filter of the parameters, which are taken for random walks.

Measured is the impulse of each row of the exact sampled regression (see `rows`), whose filter
starts anew with each stretch of sliding. The noise of such a row is the inertia times that of its
newest speed, less the fading share of the stretch's first speed: a fourth state. Covariances are
kept in units of the rows' noise, so that no tuning depends on the unit of the command.
"""

import math

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from .rows import GatedRows


class KalmanConfig(BaseModel):
    """Tuning of `KalmanEstimator`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    gate_m_s: float = Field(0.005, ge=0)
    """Rows with a slower end are left out."""
    filter_pole: float = Field(0.97, ge=0, lt=1)
    speed_noise_m_s: float = Field(5e-4, gt=0)
    drift_share_1_sqrt_s: float = Field(2e-4, ge=0)
    """Standard deviation by which a parameter walks in a second, as a share of itself."""
    initial_gain: float = Field(1e9, gt=0)
    """Variance of the parameters over that of a row, at the start."""


class KalmanEstimator:
    """Parameters as random walks, with covariance; depends on BLAS in the last digits."""

    Config = KalmanConfig

    def __init__(self, config: KalmanConfig, period_s: float) -> None:
        self._config, self._period_s = config, period_s
        self._estimate = np.zeros(4)
        self._covariance = np.diag([config.initial_gain] * 3 + [1.0])
        self._rows = GatedRows(config.gate_m_s, config.filter_pole, period_s)
        self._fading = 1.0
        self._count, self._squares = 0, 0.0

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        """Take one sample and the command that acted over the period before it.

        Returns predicted - applied command, averaged over the filter's memory.
        """
        if not self._rows.push(position_m, velocity_m_s, applied_command):
            self._restart()
            return math.nan
        self._fading *= self._config.filter_pole
        self._walk()
        return self._rows.mean_error(self._correct())

    def _restart(self) -> None:
        self._rows.restart()
        self._fading = 1.0
        self._estimate[3] = 0.0
        self._covariance[3, :] = self._covariance[:, 3] = 0.0
        self._covariance[3, 3] = 1.0

    def _walk(self) -> None:
        inertia = float(self._estimate[0])
        if inertia > 0.0 and self._count >= 10:
            share = self._config.drift_share_1_sqrt_s / (inertia * self._config.speed_noise_m_s)
            steps = (share * self._estimate[:3]) ** 2 * self._period_s
            self._covariance[[0, 1, 2], [0, 1, 2]] += steps

    def _correct(self) -> float:
        row = np.array([*self._rows.regressor, self._fading])
        error = float(row @ self._estimate) - self._rows.impulse
        step = self._covariance @ row
        spread = 1.0 + float(row @ step)
        self._estimate -= step * (error / spread)
        self._covariance -= np.outer(step, step) / spread
        self._count += 1
        if self._count > 10:
            self._squares += error * error / spread
        return error

    def parameters(self) -> tuple[float, float, float]:
        """inertia, viscous friction, Coulomb friction."""
        inertia, viscous, coulomb, _ = self._estimate.tolist()
        return inertia, viscous, coulomb

    def variances(self) -> tuple[float, float, float]:
        """From the covariance and the prediction errors so far; NaN before twenty usable rows."""
        if self._count < 20:
            return math.nan, math.nan, math.nan
        noise = self._squares / (self._count - 10)
        inertia, viscous, coulomb, _ = (noise * np.diag(self._covariance)).tolist()
        return inertia, viscous, coulomb
