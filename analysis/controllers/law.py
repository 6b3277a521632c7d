"""Controllers whose law is a pure function of numbers: such a loop can be compiled."""

from collections.abc import Callable
from typing import Any, ClassVar

from seamlog.contracts import Axis

Memory = tuple[float, ...]


class LawController:
    """A law with its gains and its memory; `law` says what all that is.

    `law(gains, memory, reference_m, reference_m_s, reference_m_s2, position_m, velocity_m_s)`
    gives the command before saturation and the next memory, whose values `state_names` names.
    It and the functions it calls use no more than `+ - * /`, sqrt and comparisons of floats
    (`analysis/compiled.py`).
    """

    law: ClassVar[Callable[..., tuple[float, Memory]]]
    state_names: ClassVar[tuple[str, ...]]

    def __init__(self, axis: Axis, period_s: float, gains: Any) -> None:
        self._axis, self._period_s = axis, period_s
        self.gains = gains
        self.memory: Memory = (0.0,) * len(self.state_names)

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: float,
        velocity_m_s: float,
    ) -> float:
        """Command before saturation."""
        wanted, self.memory = self.law(
            self.gains,
            self.memory,
            reference_m,
            reference_m_s,
            reference_m_s2,
            position_m,
            velocity_m_s,
        )
        return wanted

    def state(self) -> Memory:
        """Values in the order of `state_names`."""
        return self.memory
