"""Rulers in photos: the ticks along a line are counted by the phase of their pattern."""

from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from seamlog.calibration import Points
from seamlog.errors import EvidenceError

from .scale import KnownLength

Floats = NDArray[np.float64]

_FEWEST_TICKS = 12
_SHORTEST_PERIOD_PX = 3.0
_DISTINCT = 6.0
"""The pattern's peak in the spectrum against the median around it."""
_PARTS = 4
_HALF_BAND_PX = 2
_READING_PX = 0.25
"""How well the phase of a real ruler's ticks can be read."""


def read_ruler(
    pixels: NDArray[Any], tick_mm: float, start_px: Points, stop_px: Points, name: str
) -> list[KnownLength]:
    """Stretches of a ruler as known lengths; the line must cross ticks of one distance only.

    `EvidenceError` where no even ticks are seen. Several stretches show the tilt along the ruler.
    """
    length_px = float(np.hypot(*(stop_px - start_px)))
    if length_px < _FEWEST_TICKS * _SHORTEST_PERIOD_PX:
        raise EvidenceError(f"{name}: the line on the ruler is {length_px:.0f} px long, too short")
    profile, places = _profile(pixels, start_px, stop_px, length_px)
    ticks, scatter = _count(profile, places, tick_mm, name)
    direction = (stop_px - start_px) / length_px
    edges = np.linspace(0.06, 0.94, _PARTS + 1) * length_px
    found = []
    for first, last in pairwise(edges):
        count = float(ticks(last) - ticks(first))
        ends = (start_px + first * direction, start_px + last * direction)
        (ax, ay), (bx, by) = ends
        reading = max(scatter * (last - first) / count, _READING_PX)
        found.append(
            KnownLength(count * tick_mm, (float(ax), float(ay)), (float(bx), float(by)), reading)
        )
    return found


def _profile(
    pixels: NDArray[Any], start_px: Points, stop_px: Points, length_px: float
) -> tuple[Floats, Floats]:
    """Brightness along the line, averaged over a few px to both sides, each half px."""
    grey = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    places = np.arange(0.0, length_px, 0.5)
    along = (stop_px - start_px) / length_px
    across = np.array([-along[1], along[0]])
    sides = np.arange(-_HALF_BAND_PX, _HALF_BAND_PX + 1)
    at = start_px + places[:, None, None] * along + sides[None, :, None] * across
    sampled = cv2.remap(
        np.asarray(grey, dtype=np.float32),
        at[..., 0].astype(np.float32),
        at[..., 1].astype(np.float32),
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(sampled, dtype=np.float64).mean(axis=1), places


def _count(
    profile: Floats, places: Floats, tick_mm: float, name: str
) -> tuple[np.polynomial.Polynomial, float]:
    """Number of ticks up to a place as a smooth function, and its scatter in ticks."""
    level = gaussian_filter1d(profile, len(profile) / 12)
    signal = profile - level
    window = np.hanning(len(signal))
    spectrum = np.abs(np.fft.rfft(signal * window, 4 * len(signal)))
    frequency = np.fft.rfftfreq(4 * len(signal), 0.5)
    usable = (frequency > _FEWEST_TICKS / places[-1]) & (frequency < 1 / _SHORTEST_PERIOD_PX)
    if not usable.any():
        raise EvidenceError(f"{name}: the line on the ruler is too short for its ticks")
    peak = int(np.argmax(np.where(usable, spectrum, 0.0)))
    if spectrum[peak] < _DISTINCT * float(np.median(spectrum[usable])):
        raise EvidenceError(
            f"{name}: no even ticks along the line; draw it across the {tick_mm:g} mm ticks of the "
            "ruler only"
        )
    turned = signal * np.exp(-2j * np.pi * frequency[peak] * places)
    calm = 4.0 / frequency[peak]
    analytic = gaussian_filter1d(turned.real, calm) + 1j * gaussian_filter1d(turned.imag, calm)
    ticks = frequency[peak] * places + np.unwrap(np.angle(analytic)) / (2 * np.pi)
    inner = slice(len(places) // 20, -(len(places) // 20))
    fitted = np.polynomial.Polynomial.fit(places[inner], ticks[inner], 3)
    scatter = float(np.std(ticks[inner] - fitted(places[inner])))
    if scatter > 0.15:
        raise EvidenceError(
            f"{name}: the ticks along the line are not even (off by {scatter:.2f} of a tick)"
        )
    return fitted, scatter
