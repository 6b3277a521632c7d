"""Unscented Kalman filter of motion and parameters (Julier and Uhlmann, 1997; kappa = 0)."""

import numpy as np

from .augmented import Belief, advance
from .nonlinear import NonlinearFilter


class UnscentedKalman(NonlinearFilter):
    """The belief moves as ten states at one standard deviation each way, in all directions."""

    def _moved(self, belief: Belief, direction: float, command: float) -> Belief:
        strength, axes = np.linalg.eigh(belief.covariance)
        spread = axes * np.sqrt(5.0 * np.maximum(strength, 0.0))
        ends = advance(
            belief.mean[:, None] + np.hstack([spread, -spread]), direction, command, self._period_s
        )
        mean = ends.mean(axis=1)
        away = ends - mean[:, None]
        return Belief(mean, away @ away.T / 10.0 + self._noise)
