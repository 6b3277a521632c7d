"""How even the width is: figures of the bead itself, with the measurement noise taken out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .measurement import BeadMeasurement

Floats = NDArray[np.float64]

WINDOW_MM = 25.0
_AVERAGED_MM = 1.0


@dataclass(frozen=True, slots=True)
class Uniformity:
    """Figures over the good stations, in the measurement's unit.

    `u_mean` is the standard uncertainty of the mean: scale and edge model do not average out.
    `std` is the spread left when the mean square of the random uncertainty is subtracted, `cv` is
    std / mean. `width_range` spans all good stations; `peak_to_peak_25mm` is the largest span in
    any 25 mm along the bead of the width averaged over 1 mm, None without millimetres or where
    the bead is shorter.
    """

    stations: int
    mean: float
    u_mean: float
    std: float
    cv: float
    width_range: float
    peak_to_peak_25mm: float | None


def uniformity(measurement: BeadMeasurement) -> Uniformity | None:
    """Uniformity figures; None with fewer than three good stations."""
    good = measurement.good
    if good.sum() < 3:
        return None
    width, s = measurement.width[good], measurement.s[good]
    noise = measurement.u_noise[good]
    variance = float(np.var(width, ddof=1)) - float(np.mean(noise**2))
    std = float(np.sqrt(max(variance, 0.0)))
    mean = float(width.mean())
    systematic = np.sqrt(np.maximum(measurement.u_width[good] ** 2 - noise**2, 0))
    u_mean = float(np.hypot(systematic.mean(), np.sqrt(np.mean(noise**2) / good.sum())))
    return Uniformity(
        stations=int(good.sum()),
        mean=mean,
        u_mean=u_mean,
        std=std,
        cv=std / mean,
        width_range=float(np.ptp(width)),
        peak_to_peak_25mm=_peak_to_peak(s, width) if measurement.unit == "mm" else None,
    )


def _peak_to_peak(s_mm: Floats, width_mm: Floats) -> float | None:
    if np.ptp(s_mm) < WINDOW_MM:
        return None
    averaged = _averaged(s_mm, width_mm)
    stops = np.searchsorted(s_mm, s_mm + WINDOW_MM, side="right")
    whole = np.flatnonzero(s_mm + WINDOW_MM <= s_mm[-1] + 1e-9)
    return max(float(np.ptp(averaged[start : stops[start]])) for start in whole)


def _averaged(s_mm: Floats, width_mm: Floats) -> Floats:
    total = np.concatenate([[0.0], np.cumsum(width_mm)])
    first = np.searchsorted(s_mm, s_mm - _AVERAGED_MM / 2, side="left")
    last = np.searchsorted(s_mm, s_mm + _AVERAGED_MM / 2, side="right")
    return np.asarray((total[last] - total[first]) / (last - first))
