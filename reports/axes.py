"""The axes of a drawing: scales from values to pixels, and ticks at round numbers."""

import math
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from .numbers import decimals_for, format_number

_ROUND = (1.0, 2.0, 2.5, 5.0, 10.0)
_FINER = 0.65
"""Rather more ticks than wanted than too few."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A tick at pixel `at` with its text."""

    at: float
    text: str


@dataclass(frozen=True, slots=True)
class Scale:
    """Values from `low` to `high` on pixels from `start` to `end`."""

    low: float
    high: float
    start: float
    end: float

    def px(self, values: NDArray[Any] | float) -> Any:
        """Pixels of values, of the same shape."""
        fraction = (values - self.low) / (self.high - self.low)
        return self.start + fraction * (self.end - self.start)

    def ticks(self, wanted: int) -> list[Tick]:
        """About `wanted` ticks at round numbers."""
        found = axis_ticks(self.low, self.high, wanted)
        return [Tick(round(float(self.px(value)), 1), text) for value, text in found]


def axis_ticks(low: float, high: float, wanted: int) -> list[tuple[float, str]]:
    """About `wanted` round positions within [low, high], each with its text."""
    step = _round_step((high - low) / wanted)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    decimals = max(decimals_for(step, 2 if abs(math.log10(step / 2.5) % 1.0) < 1e-9 else 1), 0)
    return [(i * step, format_number(i * step, decimals)) for i in range(first, last + 1)]


def padded(low: float, high: float, fraction: float = 0.06) -> tuple[float, float]:
    """A range with some air around it; a single value gets a range of its own size."""
    span = (high - low) or abs(high) or 1.0
    return low - fraction * span, high + fraction * span


def _round_step(rough: float) -> float:
    power = 10.0 ** math.floor(math.log10(rough))
    return next(power * nice for nice in _ROUND if power * nice >= _FINER * rough)
