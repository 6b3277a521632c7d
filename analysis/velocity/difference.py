"""Velocity as a difference of positions: no model, and the noise of the encoder over the period."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def backward_difference(position_m: FloatArray, period_s: float) -> FloatArray:
    """(x_k - x_k-1) / T, shape (n,); causal, half a period late; 0 at the first sample."""
    return np.diff(position_m, prepend=position_m[:1]) / period_s


def central_difference(position_m: FloatArray, period_s: float) -> FloatArray:
    """(x_k+1 - x_k-1) / 2T, shape (n,); one-sided at both ends; not causal."""
    return np.asarray(np.gradient(position_m, period_s), dtype=np.float64)
