"""How much worse a figure may get before it counts as a regression."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from seamlog.errors import UsageError


@dataclass(frozen=True)
class Tolerance:
    """How much worse is still as good: a share of the base's value, or so many of its unit."""

    value: float
    relative: bool

    def allowed(self, base: float) -> float:
        """The growth that is allowed."""
        return self.value * abs(base) if self.relative else self.value


@dataclass(frozen=True)
class Tolerances:
    """One for all figures, and those of single figures by name."""

    default: Tolerance = Tolerance(0.05, True)
    named: dict[str, Tolerance] = field(default_factory=dict)

    def of(self, name: str) -> Tolerance:
        """The tolerance of a figure."""
        return self.named.get(name, self.default)


def read_tolerances(texts: Sequence[str]) -> Tolerances:
    """From texts such as `10%` (all figures), `rms_error_mm=0.05`, `width_cv=20%`."""
    default, named = Tolerances().default, {}
    for text in texts:
        name, equals, value = text.rpartition("=")
        tolerance = _tolerance(value, text)
        if equals:
            named[name.strip()] = tolerance
        elif tolerance.relative:
            default = tolerance
        else:
            raise UsageError(f"--tolerance {text}: say which figure's, as rms_error_mm={text}")
    return Tolerances(default, named)


def _tolerance(value: str, text: str) -> Tolerance:
    relative = value.strip().endswith("%")
    try:
        number = float(value.strip().removesuffix("%"))
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or number < 0:
        raise UsageError(f"--tolerance {text}: write it as 5% or NAME=0.05 or NAME=5%")
    return Tolerance(number / 100 if relative else number, relative)
