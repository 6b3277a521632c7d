"""A fence around controllers of other people: what they do wrong is named, with its time."""

import math
from collections.abc import Sequence
from typing import Any

from seamlog.contracts import Axis, Controller
from seamlog.errors import PluginFailed

MOST_STATES = 8


def make_guarded(factory: Any, config: Any, axis: Axis, period_s: float, name: str) -> Controller:
    """Make a controller of somebody else; `PluginFailed` if it raises."""
    try:
        controller = factory(config, axis, period_s)
    except Exception as error:
        raise PluginFailed(
            f"controller {name!r} cannot be made: {type(error).__name__}: {error}"
        ) from error
    return GuardedController(controller, period_s, name)


class GuardedController:
    """Passes samples on; `PluginFailed` where the controller raises or gives no finite number."""

    def __init__(self, controller: Any, period_s: float, name: str) -> None:
        self._controller, self._period_s, self._name = controller, period_s, name
        self._samples = 0
        self.state_names: Sequence[str] = tuple(getattr(controller, "state_names", ()))
        if len(self.state_names) > MOST_STATES:
            raise self._failure(
                f"has {len(self.state_names)} states, at most {MOST_STATES} can be logged"
            )

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: float,
        velocity_m_s: float,
    ) -> float:
        """Command of the controller, a finite float."""
        try:
            wanted = self._controller.output(
                reference_m, reference_m_s, reference_m_s2, position_m, velocity_m_s
            )
            command = float(wanted)
        except Exception as error:
            raise self._failure(f"raised {type(error).__name__}: {error}") from error
        if not math.isfinite(command):
            raise self._failure(f"returned {command} as its command")
        self._samples += 1
        return command

    def state(self) -> tuple[float, ...]:
        """States of the controller, as many as it names."""
        try:
            values = tuple(float(value) for value in self._controller.state())
        except Exception as error:
            raise self._failure(f"raised {type(error).__name__} in state(): {error}") from error
        if len(values) != len(self.state_names):
            raise self._failure(f"gave {len(values)} states and names {len(self.state_names)}")
        return values

    def warnings(self) -> list[str]:
        """Those of the controller, if it has any to say."""
        if not hasattr(self._controller, "warnings"):
            return []
        try:
            return [str(text) for text in self._controller.warnings()]
        except Exception as error:
            raise self._failure(f"raised {type(error).__name__} in warnings(): {error}") from error

    def _failure(self, what: str) -> PluginFailed:
        time_s = self._samples * self._period_s
        return PluginFailed(
            f"controller {self._name!r} {what} (sample {self._samples}, {time_s:.3f} s of the run)"
        )
