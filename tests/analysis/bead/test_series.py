"""Means and medians along a line, against SciPy and NumPy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d

from seamlog.analysis.bead.series import calmed, median

VALUES = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=80).map(np.array)


@given(VALUES, st.floats(0.3, 20.0))
def test_calmed_as_scipy(values: np.ndarray, sigma: float) -> None:
    expected = gaussian_filter1d(values, sigma, mode="nearest")
    np.testing.assert_allclose(calmed(values, sigma), expected, atol=1e-9)


@given(VALUES)
def test_median_as_numpy(values: np.ndarray) -> None:
    assert median(values) == np.median(values)


def test_calmed_takes_flags() -> None:
    flags = np.array([False, True, True, False])
    assert np.allclose(calmed(flags, 0.1), flags)
