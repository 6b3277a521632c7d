"""What tells a bead from its plate at each place: lightness, colour, fine detail."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .image import Photo

Features = NDArray[np.float32]
"""Shape (rows, columns, k): lightness [grey levels], two colours if there are any, log texture."""
Planes = NDArray[np.float32]
"""The same as (k, rows, columns)."""

_TEXTURE_FLOOR = 1.5
"""Grey levels of detail that count as none: 8-bit rounding and a little camera noise."""
_SAMPLES, _EVERY = 4096, 7
"""Samples that show a quantile, and how many of more are one: columns must not be missed."""
_SPOT = np.ones((7, 7), np.uint8)
"""What is textured must be broader than this: the energy of a bare edge spreads over 2.5 reaches
to both sides, and a band as narrow as that at each toe would look like a bead of its own."""


def texture_energy(lightness: NDArray[np.float32], reach_px: float) -> NDArray[np.float32]:
    """Log of the local strength of detail finer than `reach_px`, shape as given."""
    detail = lightness - cv2.GaussianBlur(lightness, (0, 0), reach_px)
    power = cv2.GaussianBlur(detail * detail, (0, 0), reach_px)
    return np.asarray(np.log(np.sqrt(np.maximum(power, 0)) + _TEXTURE_FLOOR), dtype=np.float32)


def stack_texture(opponent: NDArray[np.float32], reach_px: float) -> Features:
    """Opponent channels with their texture energy as one more channel."""
    texture = texture_energy(np.ascontiguousarray(opponent[..., 0]), reach_px)
    return np.concatenate([opponent, texture[..., None]], axis=2)


def smoothed(features: Features, across: float, along: float) -> Features:
    """Features blurred by Gaussians of `across` columns and `along` rows (0: not at all)."""
    if across:
        blurred = cv2.GaussianBlur(features, (0, 0), sigmaX=across, sigmaY=along)
    else:
        blurred = cv2.GaussianBlur(features, (1, 0), sigmaX=0.01, sigmaY=along)
    return np.asarray(blurred, dtype=np.float32).reshape(features.shape)


def strip_features(opponent: NDArray[np.float32], reach_px: float) -> Features:
    """As `stack_texture`, for strips: the texture's outer border is drawn in by its own reach.

    A window that touches the bead's edge sees that edge as detail, and the logarithm lifts its
    Gaussian tail to some 2.5 reaches; without the correction the texture alone would put each toe
    that much too far out.
    """
    features = stack_texture(opponent, reach_px)
    wide = 2 * round(2.5 * reach_px) + 1
    features[..., -1] = cv2.erode(features[..., -1], np.ones((1, wide), np.uint8))
    return features


def reduced_features(photo: Photo, longest_px: int) -> tuple[Features, float]:
    """Features of the photo reduced to `longest_px`, and the photo px per reduced px.

    Texture is taken before reducing, so that fine detail still counts.
    """
    factor = max(1.0, max(photo.width_px, photo.height_px) / longest_px)
    reach = max(1.5, 0.75 * factor)
    full = stack_texture(photo.opponent(), reach)
    size = (round(photo.width_px / factor), round(photo.height_px / factor))
    reduced: NDArray[Any] = cv2.resize(full, size, interpolation=cv2.INTER_AREA)
    features = reduced.reshape(size[1], size[0], -1).astype(np.float32)
    features[..., -1] = cv2.morphologyEx(features[..., -1], cv2.MORPH_OPEN, _SPOT)
    return features, factor


def planes_of(features: Features) -> Planes:
    """Features with a plane for each, which lie together."""
    return np.ascontiguousarray(np.moveaxis(features, 2, 0))


def in_spreads(planes: Planes) -> Planes:
    """Features in units of their spread, which has floors below which a change means nothing."""
    floors = np.full(len(planes), 3.0)
    floors[0], floors[-1] = 6.0, 0.25
    bounds = np.array([quantiles(plane.ravel(), 0.16) for plane in planes])
    spread = np.maximum((bounds[:, 1] - bounds[:, 0]) / 2, floors).astype(np.float32)
    return np.asarray(planes / spread[:, None, None])


def quantiles(values: NDArray[np.float32], share: float) -> tuple[float, float]:
    """The quantiles `share` and 1 - `share` of values (n,), of many from every few of them.

    As of `np.quantile`, whose look for NaN takes longer than all the rest.
    """
    values = values[:: min(_EVERY, 1 + len(values) // _SAMPLES)]
    last = len(values) - 1
    below, part = int(share * last), share * last % 1
    order = [below, min(below + 1, last), max(last - below - 1, 0), last - below]
    low, next_low, next_high, high = np.partition(values, order)[order].astype(np.float64)
    return float(low + part * (next_low - low)), float(high + part * (next_high - high))
