"""A fence around estimators of other people: what they do wrong is named, with its sample."""

from collections.abc import Callable
from typing import Any, TypeVar

from seamlog.contracts import Estimator
from seamlog.errors import PluginFailed

Value = TypeVar("Value")


def make_guarded_estimator(factory: Any, config: Any, period_s: float, name: str) -> Estimator:
    """Make an estimator of somebody else; `PluginFailed` if it raises, now or later."""
    return GuardedEstimator(_tried(lambda: factory(config, period_s), name, "cannot be made"), name)


class GuardedEstimator:
    """Passes samples on; `PluginFailed` where the estimator raises or gives no three numbers."""

    def __init__(self, estimator: Any, name: str) -> None:
        self._estimator, self._name, self._samples = estimator, name, 0

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        """Prediction error of the estimator; NaN is allowed, it has none at first."""
        error = _tried(
            lambda: float(self._estimator.update(position_m, velocity_m_s, applied_command)),
            self._name,
            f"failed at sample {self._samples}",
        )
        self._samples += 1
        return error

    def parameters(self) -> tuple[float, float, float]:
        """inertia, viscous friction, Coulomb friction."""
        return self._three(self._estimator.parameters)

    def variances(self) -> tuple[float, float, float]:
        """Variances of the three."""
        return self._three(self._estimator.variances)

    def _three(self, ask: Callable[[], Any]) -> tuple[float, float, float]:
        def three() -> tuple[float, float, float]:
            first, second, third = ask()
            return float(first), float(second), float(third)

        return _tried(three, self._name, f"failed after {self._samples} samples")


def _tried(act: Callable[[], Value], name: str, what: str) -> Value:
    try:
        return act()
    except Exception as error:
        raise PluginFailed(f"estimator {name!r} {what}: {type(error).__name__}: {error}") from error
