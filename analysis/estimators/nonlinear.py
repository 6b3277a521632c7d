"""What the extended and the unscented filter share: all but how a belief moves on."""

import math
from abc import ABC, abstractmethod

from .augmented import (
    AugmentedConfig,
    Belief,
    first_belief,
    measured,
    physical_parameters,
    physical_variances,
    process_noise,
    restarted,
)


class NonlinearFilter(ABC):
    """Axis motion and parameters in one state; results depend on BLAS in the last digits."""

    Config = AugmentedConfig

    def __init__(self, config: AugmentedConfig, period_s: float) -> None:
        self._config, self._period_s = config, period_s
        self._noise = process_noise(config, period_s)
        self._belief: Belief | None = None
        self._last_m_s = math.nan

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        """Take one sample and the command that acted over the period before it.

        Returns predicted - applied command: what the speed differs from the predicted one, as a
        command. NaN where the period taught nothing.
        """
        seen, before = (position_m, velocity_m_s), self._last_m_s
        self._last_m_s = velocity_m_s
        if self._belief is None:
            if math.isfinite(position_m + velocity_m_s):
                self._belief = first_belief(self._config, position_m, velocity_m_s)
            return math.nan
        gate = self._config.gate_m_s
        low, high = min(before, velocity_m_s), max(before, velocity_m_s)
        whole = math.isfinite(position_m + velocity_m_s + before + applied_command)
        if not whole or not (low > gate or high < -gate):
            self._belief = restarted(self._belief, seen, self._config)
            return math.nan
        predicted = self._moved(self._belief, 1.0 if low > 0.0 else -1.0, applied_command)
        self._belief = measured(predicted, seen, self._config)
        per_command = float(predicted.mean[2]) * self._period_s
        missed = velocity_m_s - float(predicted.mean[1])
        return missed / per_command if per_command > 0.0 else math.nan

    @abstractmethod
    def _moved(self, belief: Belief, direction: float, command: float) -> Belief:
        """The belief one period later, before the measurement."""

    def parameters(self) -> tuple[float, float, float]:
        """inertia, viscous friction, Coulomb friction; 0 until they are known."""
        return physical_parameters(self._belief) if self._belief else (0.0, 0.0, 0.0)

    def variances(self) -> tuple[float, float, float]:
        """Variances of the three; NaN until they are known."""
        nan = math.nan
        return physical_variances(self._belief) if self._belief else (nan, nan, nan)
