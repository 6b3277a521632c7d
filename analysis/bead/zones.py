"""Bead and plate as zones of the strip: how each looks, and which of the two a place looks like."""

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from . import loops
from .features import Features, Planes, quantiles
from .loops import loaded

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
    mean = samples.mean(axis=0, dtype=np.float64)
    apart = samples - mean
    return Look(mean, apart.T @ apart / (len(samples) - 1) + np.diag(floors))


@dataclass(frozen=True, slots=True)
class Zone:
    """Columns [first, end) per row, where the photo has samples."""

    first: Places
    end: Places
    valid: NDArray[np.bool_]

    @classmethod
    def between(cls, start: Floats, stop: Floats, valid: NDArray[np.bool_]) -> "Zone":
        """Columns in [start, stop) per row."""
        return cls(np.ceil(start).astype(np.int64), np.ceil(stop).astype(np.int64), valid)

    def mask(self) -> NDArray[np.bool_]:
        """Whether each place belongs to it."""
        at = np.arange(self.valid.shape[1])
        return (at >= self.first[:, None]) & (at < self.end[:, None]) & self.valid


@dataclass(frozen=True, slots=True)
class Shares:
    """How often each look of colours and of texture occurs in a zone, smoothed; its places."""

    colours: Floats
    texture: Floats
    places: int


@dataclass(frozen=True, slots=True)
class Looks:
    """How each place of a strip looks: the bin of its colours together and that of its texture.

    Colours are counted together, since a bead has many: metal, slag, glare.
    """

    colours: Places
    channels: int
    texture: Places

    def shares(self, zone: Zone) -> Shares:
        """How often each look occurs in a zone."""
        count = loaded(loops.counted)
        if count is not None:
            where = zone.first, zone.end, zone.valid
            colours = count(self.colours, *where, _BINS**self.channels)
            texture = count(self.texture, *where, _BINS)
        else:
            at = np.flatnonzero(zone.mask())
            colours = np.bincount(self.colours.take(at), minlength=_BINS**self.channels)
            texture = np.bincount(self.texture.take(at), minlength=_BINS)
        return Shares(_shares(colours, self.channels), _shares(texture, 1), int(texture.sum()))

    def likeness(self, inside: Shares, outside: Shares) -> NDArray[np.float32]:
        """Log-likelihood ratio inside : outside per place (n,), by the shares in two zones.

        Texture weighs less than colours. Clipped, so that no place decides alone.
        """
        colours = np.log(inside.colours / outside.colours).astype(np.float32)
        texture = (_TEXTURE * np.log(inside.texture / outside.texture)).astype(np.float32)
        look_up = loaded(loops.looked_up) or _looked_up
        found = look_up(self.colours, self.texture, colours, texture, np.float32(_CLIP))
        return np.asarray(found)


def _looked_up(
    colours: Places,
    texture: Places,
    by_colour: NDArray[np.float32],
    by_texture: NDArray[np.float32],
    most: np.float32,
) -> NDArray[np.float32]:
    """Sums of what is said of each place's colours and of its texture, clipped."""
    found = by_colour.take(colours)
    found += by_texture.take(texture)
    return np.clip(found, -most, most, out=found)


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


def _shares(counted: Places, channels: int) -> Floats:
    """How often each bin of a smoothed histogram occurs, flat."""
    places = counted.sum()
    smooth = counted.astype(np.float64)
    for _ in range(channels):
        smooth = (_SMOOTHING @ smooth.reshape(_BINS, -1)).T
    return np.asarray(smooth.ravel() / max(places, 1e-6) + _RARE)


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
