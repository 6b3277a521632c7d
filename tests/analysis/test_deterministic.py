import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seamlog.analysis.deterministic import arctangent, exponential, log_one_plus

RELATIVE = 2e-15


@given(st.floats(-1e300, 1e300))
def test_arctangent_agrees_with_libm(x: float) -> None:
    assert arctangent(x) == pytest.approx(math.atan(x), rel=RELATIVE, abs=5e-324)


@given(st.floats(-700.0, 700.0))
def test_exponential_agrees_with_libm(x: float) -> None:
    assert exponential(x) == pytest.approx(math.exp(x), rel=RELATIVE)


@given(st.floats(-0.999, 1e12) | st.floats(-1e-6, 1e-6) | st.floats(-0.3, 0.3))
def test_log_one_plus_agrees_with_libm(x: float) -> None:
    assert log_one_plus(x) == pytest.approx(math.log1p(x), rel=RELATIVE, abs=5e-324)


def test_the_ends_of_the_ranges() -> None:
    assert exponential(-1e9) == 0.0
    assert exponential(0.0) == 1.0
    assert arctangent(math.inf) == math.pi / 2
    with pytest.raises(OverflowError):
        exponential(1000.0)


def test_nan_stays_nan() -> None:
    assert math.isnan(arctangent(math.nan))
    assert math.isnan(exponential(math.nan))
