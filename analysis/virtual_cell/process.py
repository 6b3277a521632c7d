"""Current, voltage and wire feed of a short-arc weld, sampled with the loop."""

import numpy as np

_MEANS = np.array([168.0, 19.8, 5.4])
_SPREADS = np.array([7.0, 0.7, 0.04])
_MEMORY = 0.6
_START_S = 0.25


class WeldProcess:
    """Correlated noise about the set point, a current surge at the start; 0 without an arc."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._wander = np.zeros(3)

    def sample(self, since_arc_s: float | None) -> tuple[float, float, float]:
        """current_a, voltage_v, wire_feedrate_m_min; None: no arc."""
        fresh = np.sqrt(1.0 - _MEMORY**2) * self._rng.standard_normal(3)
        self._wander = _MEMORY * self._wander + fresh
        if since_arc_s is None:
            return 0.0, 0.0, 0.0
        values = _MEANS + _SPREADS * self._wander
        surge = max(0.0, 1.0 - since_arc_s / _START_S)
        return (
            float(values[0] + 90.0 * surge),
            float(values[1] - 5.0 * surge),
            float(values[2] * (1.0 - 0.5 * surge)),
        )
