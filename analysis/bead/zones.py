"""Bead and plate as zones of the strip: how each looks, and which of the two a place looks like."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .features import Features

Floats = NDArray[np.float64]

_CLIP = 2.5


@dataclass(frozen=True, slots=True)
class Look:
    """Mean and covariance of the features of a zone."""

    mean: Floats
    covariance: Floats

    def distance(self, features: Features) -> NDArray[np.float32]:
        """Mahalanobis distance squared plus log determinant, per place."""
        root = np.linalg.cholesky(np.linalg.inv(self.covariance)).astype(np.float32)
        away = (features - self.mean.astype(np.float32)) @ root
        away *= away
        return np.asarray(away.sum(axis=-1) + np.float32(np.linalg.slogdet(self.covariance)[1]))


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


def bead_likeness(
    features: Features, bead: Sequence[Look], plate: Sequence[Look]
) -> NDArray[np.float32]:
    """Log-likelihood ratio bead : plate per place, each as its best-fitting look.

    Clipped, so that no single place decides.
    """
    like_bead = np.minimum.reduce([look.distance(features) for look in bead])
    like_plate = np.minimum.reduce([look.distance(features) for look in plate])
    return np.asarray(np.clip(0.5 * (like_plate - like_bead), -_CLIP, _CLIP))


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
