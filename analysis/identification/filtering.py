"""Offline filters of identification: zero phase, central differences, decimation.

They follow what published IDIM-LS studies computed with MATLAB, so that their tables can be
checked digit by digit: padding of `filtfilt` is three times the filter order, and decimation
keeps the samples that end with the last one.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

FloatArray = NDArray[np.float64]

_RIPPLE_DB = 0.05
_DECIMATION_ORDER = 8


def smooth_zero_phase(values: FloatArray, cutoff: float, order: int = 4) -> FloatArray:
    """Butterworth low pass, forward and backward; `cutoff` relative to the Nyquist frequency."""
    b, a = signal.butter(order, cutoff)
    return _filtfilt(b, a, values, order)


def central_difference(values: FloatArray, period_s: float) -> FloatArray:
    """First derivative, one-sided at both ends."""
    return np.asarray(np.gradient(values, period_s), dtype=np.float64)


def decimate(values: FloatArray, factor: int) -> FloatArray:
    """Low pass and keep each `factor`-th sample, counted from the last one backwards.

    `values` has shape (n,) or (n, columns); the kept samples are those of `decimated`.
    """
    if factor == 1:
        return values
    b, a = signal.cheby1(_DECIMATION_ORDER, _RIPPLE_DB, 0.8 / factor)
    return decimated(_filtfilt(b, a, values, _DECIMATION_ORDER), factor)


def decimated(values: NDArray[Any], factor: int) -> NDArray[Any]:
    """Each `factor`-th sample such that the last one is kept."""
    return values[(len(values) - 1) % factor :: factor]


def _filtfilt(b: FloatArray, a: FloatArray, values: FloatArray, order: int) -> FloatArray:
    smooth = signal.filtfilt(b, a, values, axis=0, padlen=3 * order)
    return np.asarray(smooth, dtype=np.float64)
