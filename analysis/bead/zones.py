"""Bead and plate as zones of the strip: how each looks, and which of the two a place looks like."""

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from .features import Features, Planes, quantiles

Floats = NDArray[np.float64]
Places = NDArray[np.int64]

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


@dataclass(frozen=True, slots=True)
class Looks:
    """How each place of a strip looks: the bin of its colours together and that of its texture.

    Colours are counted together, since a bead has many: metal, slag, glare.
    """

    colours: Places
    channels: int
    texture: Places

    def shares(self, mask: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """How often each look occurs in a zone: colours and texture, smoothed."""
        at = np.flatnonzero(mask)
        return _shares(self.colours.take(at), self.channels), _shares(self.texture.take(at), 1)

    def likeness(
        self, inside: tuple[Floats, Floats], outside: tuple[Floats, Floats]
    ) -> NDArray[np.float32]:
        """Log-likelihood ratio inside : outside per place (n,), by the shares in two zones.

        Texture weighs less than colours. Clipped, so that no place decides alone.
        """
        colours, texture = (np.log(a / b) for a, b in zip(inside, outside, strict=True))
        ratio = colours.astype(np.float32).take(self.colours)
        ratio += (_TEXTURE * texture).astype(np.float32).take(self.texture)
        return np.clip(ratio, -_CLIP, _CLIP, out=ratio)


def looks_of(planes: Planes) -> Looks:
    """The looks of a strip's places, row by row."""
    *colours, texture = (_bins(plane.ravel()) for plane in planes)
    together = functools.reduce(lambda places, more: places * _BINS + more, colours)
    return Looks(together, len(colours), texture)


def _bins(plane: NDArray[np.float32]) -> Places:
    low, high = quantiles(plane, 0.01)
    bins = plane - np.float32(low)
    bins /= np.float32(max((high - low) / _SPAN, 1e-3))
    bins += np.float32((_BINS - _SPAN) // 2)
    return np.clip(bins, 0, _BINS - 1, out=bins).astype(np.int64)


def _shares(places: Places, channels: int) -> Floats:
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
