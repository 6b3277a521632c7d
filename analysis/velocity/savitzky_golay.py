"""Velocity as the slope of a polynomial fitted to a window (Savitzky and Golay, 1964)."""

import numpy as np
from scipy import signal

from .difference import FloatArray


def savitzky_golay_causal(
    position_m: FloatArray, period_s: float, window: int = 5, order: int = 2
) -> FloatArray:
    """Slope at the newest of `window` samples, shape (n,); NaN until the window is full."""
    slope = signal.savgol_coeffs(window, order, deriv=1, delta=period_s, pos=window - 1, use="conv")
    velocity = np.asarray(signal.lfilter(slope, [1.0], position_m), dtype=np.float64)
    velocity[: window - 1] = np.nan
    return velocity


def savitzky_golay_centred(
    position_m: FloatArray, period_s: float, window: int = 7, order: int = 3
) -> FloatArray:
    """Slope at the middle of `window` samples (odd), shape (n,); the ends by the last fits."""
    slope = signal.savgol_filter(position_m, window, order, deriv=1, delta=period_s)
    return np.asarray(slope, dtype=np.float64)
