"""Bead and plate as zones of the strip: how each looks, and which of the two a place looks like."""

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from .features import Features, Planes, quantiles

Floats = NDArray[np.float64]

_CLIP = 3.0
_TEXTURE = 0.3
"""Weight of the texture's evidence against that of the colours."""
_SPAN, _BINS = 16, 24
"""Bins between the 1st and the 99th percentile of a channel, and all of them."""
_SMOOTHING = gaussian_filter1d(np.eye(_BINS), 2.0, axis=0)
"""Matrix that smooths a histogram; applied and turned once per channel it does so in all."""
_RARE = 1e-4
"""Share that any look has in any zone."""


@dataclass(frozen=True, slots=True)
class Look:
    """Mean and covariance of the features of a zone."""

    mean: Floats
    covariance: Floats


def look_of(samples: Features) -> Look:
    """Look of samples (n, k), with floors so that flat zones stay comparable."""
    if len(samples) < 8:
        raise ValueError("too few samples for a zone")
    floors = np.full(samples.shape[1], 4.0)
    floors[0], floors[-1] = 9.0, 0.02
    covariance = np.cov(samples.T.astype(np.float64)).reshape(len(floors), len(floors))
    return Look(samples.mean(axis=0, dtype=np.float64), covariance + np.diag(floors))


def zone(columns: int, start: Floats, stop: Floats, valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask of columns in [start, stop) per row, where the photo has samples."""
    at = np.arange(columns, dtype=np.int32)
    first, end = (np.ceil(bound).astype(np.int32)[:, None] for bound in (start, stop))
    return (at >= first) & (at < end) & valid


def likeness(
    planes: Planes, inside: NDArray[np.bool_], outside: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Log-likelihood ratio inside : outside per place, by how often its look occurs in each.

    Colours are counted together, in a smoothed histogram, since a bead has many: metal, slag,
    glare. Texture is counted by itself and weighs less. Clipped, so that no place decides alone.
    """
    flat = planes.reshape(len(planes), -1)
    zones = np.flatnonzero(inside), np.flatnonzero(outside)
    ratio = _log_ratio(flat[:-1], *zones)
    ratio += np.float32(_TEXTURE) * _log_ratio(flat[-1:], *zones)
    return np.clip(ratio, -_CLIP, _CLIP, out=ratio).reshape(inside.shape)


def _log_ratio(
    planes: NDArray[np.float32], inside: NDArray[np.int64], outside: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Of the channels `planes` (k, places) together, by the places of both zones."""
    both = np.concatenate([inside, outside])
    bins = (_bins(plane, *quantiles(plane.take(both), 0.01)) for plane in planes)
    places = functools.reduce(lambda places, more: places * _BINS + more, bins)
    a, b = (_shares(places.take(zone_), len(planes)) for zone_ in (inside, outside))
    return np.log(a / b).astype(np.float32).take(places)


def _bins(plane: NDArray[np.float32], low: float, high: float) -> NDArray[np.int64]:
    bins = plane - np.float32(low)
    bins /= np.float32(max((high - low) / _SPAN, 1e-3))
    bins += np.float32((_BINS - _SPAN) // 2)
    return np.clip(bins, 0, _BINS - 1, out=bins).astype(np.int64)


def _shares(places: NDArray[np.int64], channels: int) -> Floats:
    """How often each bin of a smoothed histogram occurs, flat."""
    counted = np.bincount(places, minlength=_BINS**channels).astype(np.float64)
    for _ in range(channels):
        counted = (_SMOOTHING @ counted.reshape(_BINS, -1)).T
    return np.asarray(counted.ravel() / max(len(places), 1e-6) + _RARE)


def fisher_direction(inside: Features, outside: Features) -> tuple[Floats, float]:
    """Direction (k,) in which two groups of samples differ most, and their distance in it.

    The distance is in standard deviations; the direction is scaled so that noise of one grey
    level in all channels keeps its size.
    """
    a, b = look_of(inside), look_of(outside)
    direction = np.linalg.solve(a.covariance + b.covariance, a.mean - b.mean)
    norm = float(np.linalg.norm(direction))
    if norm < 1e-12:
        direction = np.zeros(len(direction))
        direction[0] = norm = 1.0
    spread = float(np.sqrt(direction @ (a.covariance + b.covariance) @ direction / 2))
    return np.asarray(direction / norm, dtype=np.float64), float(
        direction @ (a.mean - b.mean)
    ) / spread
