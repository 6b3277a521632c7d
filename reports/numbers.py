"""The one place that turns numbers into text: as many digits as the uncertainty allows.

A value with standard uncertainty u is printed with U = 2 u (k = 2) to two significant digits and
the value to the same decimal. Without u three significant digits are kept.
"""

import math
from dataclasses import dataclass

from seamlog.results import Figure

COVERAGE = 2
"""Coverage factor k of every printed U."""

MINUS = "\N{MINUS SIGN}"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_DIGITS_WITHOUT_U = 3
_LARGEST_PLAIN, _SMALLEST_PLAIN = 6, -4


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number as text: value, expanded uncertainty ('' if unknown), unit ('' if none)."""

    value: str
    expanded: str = ""
    unit: str = ""
    power: str = ""

    def __str__(self) -> str:
        inner = f"{self.value} ± {self.expanded}" if self.expanded else self.value
        if self.power:
            inner = f"({inner}) × {self.power}" if self.expanded else f"{inner} × {self.power}"
        return f"{inner} {self.unit}" if self.unit else inner


def figure_quantity(figure: Figure) -> Quantity:
    """Value, U and unit of a figure that has a value."""
    if figure.value is None:
        raise ValueError(f"figure {figure.name!r} has no value; show its reason instead")
    return quantity(figure.value, figure.u, figure.unit)


def format_quantity(value: float | str, u: float | None = None, unit: str = "") -> str:
    """Text such as '7.84 ± 0.12 mm'; words and whole numbers stay as they are."""
    return str(quantity(value, u, unit))


def quantity(value: float | str, u: float | None = None, unit: str = "") -> Quantity:
    """`value` with as many digits as U = 2 u allows."""
    spelled = "" if unit == "1" else spelled_unit(unit)
    if isinstance(value, str):
        return Quantity(value, unit=spelled)
    if not math.isfinite(value):
        return Quantity("not finite")
    expanded = COVERAGE * u if u is not None and math.isfinite(u) and u > 0 else None
    largest = max(abs(value), expanded or 0.0)
    exponent = math.floor(math.log10(largest)) if largest > 0 else 0
    if isinstance(value, int) and expanded is None:
        return Quantity(str(value).replace("-", MINUS), unit=spelled)
    power, scale = "", 1.0
    if not _SMALLEST_PLAIN <= exponent <= _LARGEST_PLAIN:
        power, scale = f"10{str(exponent).translate(_SUPERSCRIPTS)}", 10.0**-exponent
    if expanded is None:
        return Quantity(_significant(value * scale), "", spelled, power)
    return Quantity(*_pair(value * scale, expanded * scale), spelled, power)


def curve_decimals(span: float, expanded: float | None) -> int:
    """Decimals of a point of a curve: two digits of its U, else a part of its span."""
    if expanded is not None and math.isfinite(expanded) and expanded > 0:
        return max(decimals_for(expanded, 2), 0)
    return max(decimals_for(span / 200), 0) if math.isfinite(span) and span > 0 else 3


def format_number(value: float, decimals: int) -> str:
    """`value` to `decimals` (negative: tens, hundreds), with a true minus sign."""
    rounded = round(value, decimals) + 0.0
    return f"{rounded:.{max(decimals, 0)}f}".replace("-", MINUS)


def decimals_for(step: float, digits: int = 1) -> int:
    """Decimals that show `step` (> 0) to `digits` significant digits."""
    return digits - 1 - math.floor(math.log10(float(f"{step:.{digits - 1}e}")))


def _pair(value: float, expanded: float) -> tuple[str, str]:
    decimals = decimals_for(expanded, 2)
    return format_number(value, decimals), format_number(expanded, decimals)


def _significant(value: float) -> str:
    if value == 0:
        return "0"
    text = format_number(value, max(decimals_for(abs(value), _DIGITS_WITHOUT_U), 0))
    return text.rstrip("0").rstrip(".") if "." in text else text


_SPELLED = {"um": "µm", "Ohm": "Ω", "deg": "°", "percent": "%"}


def spelled_unit(unit: str) -> str:
    """A unit as it is printed."""
    return _SPELLED.get(unit, unit).replace("^2", "²").replace("^3", "³")
