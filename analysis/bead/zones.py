"""Bead and plate as zones of the strip: how each looks, and which of the two a place looks like."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from .features import Features

Floats = NDArray[np.float64]

_CLIP = 3.0
_TEXTURE = 0.3
"""Weight of the texture's evidence against that of the colours."""
_SPAN, _BINS = 16, 24
"""Bins between the 1st and the 99th percentile of a channel, and all of them."""
_SMOOTH = 2.0
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
    at = np.arange(columns)
    return (at >= start[:, None]) & (at < stop[:, None]) & valid


def likeness(
    features: Features, inside: NDArray[np.bool_], outside: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Log-likelihood ratio inside : outside per place, by how often its look occurs in each.

    Colours are counted together, in a smoothed histogram, since a bead has many: metal, slag,
    glare. Texture is counted by itself and weighs less. Clipped, so that no place decides alone.
    """
    colour = _log_ratio(features[..., :-1], inside, outside)
    texture = _log_ratio(features[..., -1:], inside, outside)
    ratio = colour + np.float32(_TEXTURE) * texture
    return np.asarray(np.clip(ratio, -_CLIP, _CLIP), dtype=np.float32)


def _log_ratio(
    features: Features, inside: NDArray[np.bool_], outside: NDArray[np.bool_]
) -> NDArray[np.float32]:
    low, high = np.percentile(features[inside | outside], (1, 99), axis=0)
    width = np.maximum((high - low) / _SPAN, 1e-3).astype(np.float32)
    margin = (_BINS - _SPAN) // 2
    bins = np.clip((features - low.astype(np.float32)) / width + margin, 0, _BINS - 1)
    places = bins.astype(np.int32) @ (_BINS ** np.arange(features.shape[-1])).astype(np.int32)
    shape = (_BINS,) * features.shape[-1]
    shares = []
    for zone_ in (inside, outside):
        counted = np.bincount(places[zone_], minlength=_BINS ** len(shape)).reshape(shape)
        smooth = gaussian_filter(counted.astype(np.float32), _SMOOTH)
        shares.append(smooth / max(float(smooth.sum()), 1e-6) + _RARE)
    ratio = np.log(shares[0] / shares[1]).ravel().astype(np.float32)
    return np.asarray(ratio[places])


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
