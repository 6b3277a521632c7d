"""Round numbers for the axes of a drawing."""

import math

from .numbers import decimals_for, format_number

_ROUND = (1.0, 2.0, 2.5, 5.0, 10.0)
_FINER = 0.65
"""Rather more ticks than wanted than too few."""


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
