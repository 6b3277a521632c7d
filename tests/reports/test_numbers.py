"""Numbers as text."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seamlog.reports.numbers import curve_decimals, format_number, format_quantity


@pytest.mark.parametrize(
    ("value", "u", "unit", "text"),
    [
        (7.8412, 0.06, "mm", "7.84 ± 0.12 mm"),
        (1.02134, 0.0041, "N s^2/m", "1.0213 ± 0.0082 N s²/m"),
        (-0.5, 0.05, "mm", "−0.50 ± 0.10 mm"),
        (12345.6, 600, "mm", "12300 ± 1200 mm"),
        (0.00001234, 0.0000005, "m", "(1.23 ± 0.10) × 10⁻⁵ m"),
        (0, 0.3, "mm", "0.00 ± 0.60 mm"),
        (9.96, 0.4985, "mm", "10.0 ± 1.0 mm"),
        (10_431, None, "", "10431"),
        (84.0, None, "ms", "84 ms"),
        (0.28251, None, "mm", "0.283 mm"),
        (1234.4, None, "mm", "1234 mm"),
        (-3, None, "1", "−3"),
        ("clockwise", None, "", "clockwise"),
        (4.2, math.inf, "mm", "4.2 mm"),
        (math.inf, None, "mm", "not finite"),
        (0.0, None, "mm", "0 mm"),
        (2.5e9, None, "B", "2.5 × 10⁹ B"),
    ],
)
def test_quantity(value: float | str, u: float | None, unit: str, text: str) -> None:
    assert format_quantity(value, u, unit) == text


@given(st.floats(-1e5, 1e5), st.floats(1e-3, 1e3))
def test_what_is_printed_lies_within_a_twentieth_of_u_of_the_value(value: float, u: float) -> None:
    text = format_quantity(value, u).replace("−", "-")
    shown, expanded = (float(part) for part in text.split(" ± "))
    assert abs(shown - value) <= 0.051 * 2 * u
    assert expanded == pytest.approx(2 * u, rel=0.051)


def test_no_minus_zero() -> None:
    assert format_number(-0.0004, 2) == "0.00"


def test_curve_decimals_follow_the_band_or_the_span() -> None:
    assert curve_decimals(2.0, 0.12) == 2
    assert curve_decimals(2.0, None) == 2
    assert curve_decimals(200.0, None) == 0
