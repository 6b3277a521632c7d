"""Values along a line: their Gaussian means and medians, for a few hundred of them at a time.

As SciPy and NumPy compute them, without what those spend on each call: a bead takes a hundred.
"""

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def calmed(values: NDArray[Any], sigma: float) -> Floats:
    """Gaussian means of values (n,) over `sigma` (in samples); the ends go on as they are."""
    row = values.astype(np.float64)[None]
    found = cv2.filter2D(row, -1, _gaussian(sigma), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(found[0])


@lru_cache(maxsize=64)
def _gaussian(sigma: float) -> Floats:
    """Weights (1, 2 k + 1) to four sigmas."""
    reach = int(4 * sigma + 0.5)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.asarray(weights / weights.sum())[None]


def median(values: NDArray[Any]) -> float:
    """Median of values (n,)."""
    last = len(values) - 1
    low, high = last // 2, last - last // 2
    parted = np.partition(values, (low, high))
    return float(parted[low] + parted[high]) / 2
