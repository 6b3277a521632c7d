"""Extended Kalman filter of motion and parameters (Jacobian by central differences)."""

import numpy as np

from .augmented import Belief, advance
from .nonlinear import NonlinearFilter

_STEPS = np.array([1e-4, 1e-4, 1e-4, 1e-4, 1e-4])


class ExtendedKalman(NonlinearFilter):
    """The belief moves along the tangent of the axis model at its mean."""

    def _moved(self, belief: Belief, direction: float, command: float) -> Belief:
        around = belief.mean[:, None] + np.hstack([np.diag(_STEPS), -np.diag(_STEPS)])
        ends = advance(around, direction, command, self._period_s)
        tangent = (ends[:, :5] - ends[:, 5:]) / (2.0 * _STEPS)
        mean = advance(belief.mean, direction, command, self._period_s)
        return Belief(mean, tangent @ belief.covariance @ tangent.T + self._noise)
