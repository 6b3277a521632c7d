"""Two photos of one place: the map from one to the other by marks that both show."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .image import Photo

_LONGEST_PX = 1600
_FEATURES = 4000
_DISTINCT = 0.75
"""Lowe (2004): the best likeness against the next best."""
FEWEST_MATCHES = 15
REACH_PX = 3.0
"""How far marks may lie from where the others put them."""


def match_photos(source: Photo, target: Photo) -> NDArray[np.float64] | None:
    """Homography of `source` px to `target` px, or None where they share too few marks."""
    (from_px, from_looks), (to_px, to_looks) = (_features(photo) for photo in (source, target))
    if from_looks is None or to_looks is None or min(len(from_looks), len(to_looks)) < 2:
        return None
    both = cv2.BFMatcher().knnMatch(from_looks, to_looks, k=2)
    pairs = [m for m, *rest in both if rest and m.distance < _DISTINCT * rest[0].distance]
    if len(pairs) < FEWEST_MATCHES:
        return None
    seen = from_px[[m.queryIdx for m in pairs]], to_px[[m.trainIdx for m in pairs]]
    matrix, agreed = cv2.findHomography(*seen, cv2.RANSAC, REACH_PX)
    if matrix is None or int(np.sum(agreed)) < max(FEWEST_MATCHES, 0.15 * len(pairs)):
        return None
    return np.asarray(matrix, dtype=np.float64)


def _features(photo: Photo) -> tuple[NDArray[np.float64], NDArray[Any] | None]:
    light = photo.opponent()[..., 0]
    shrink = min(1.0, _LONGEST_PX / max(light.shape))
    small = cv2.resize(light, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    grey = np.clip(small, 0, 255).astype(np.uint8)
    finder = cv2.SIFT_create(_FEATURES)  # type: ignore[attr-defined]
    keys, looks = finder.detectAndCompute(grey, None)
    places = np.array([key.pt for key in keys], dtype=np.float64).reshape(-1, 2)
    return places / shrink, looks
