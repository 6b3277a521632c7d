"""The photo with what was measured drawn on it, so that a person can check every station."""

import cv2
import numpy as np
from numpy.typing import NDArray

from .image import Photo
from .measurement import BeadMeasurement
from .plane import Points

_TOE, _CENTRE, _FLAGGED = (80, 220, 60), (220, 90, 200), (40, 40, 230)
_LONGEST_PX = 1600


def overlay(photo: Photo, measurement: BeadMeasurement) -> NDArray[np.uint8]:
    """Toes green, flagged stations red, centreline violet, a ring at s = 0; uint8 BGR.

    Reduced to at most 1600 px.
    """
    picture = photo.as_bgr8()
    factor = min(1.0, _LONGEST_PX / max(picture.shape[:2]))
    if factor < 1:
        reduced = cv2.resize(picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
        picture = np.asarray(reduced, dtype=np.uint8)
    thick = max(1, round(max(picture.shape[:2]) / 600))
    _line(picture, measurement.centre_px * factor, _CENTRE, 1)
    good = measurement.good
    for toe in (measurement.left_px, measurement.right_px):
        for colour, mask in ((_TOE, good), (_FLAGGED, ~good)):
            for start, stop in _runs(mask):
                _line(picture, toe[start : stop + 1] * factor, colour, thick)
    x, y = np.rint(measurement.centre_px[0] * factor).astype(int)
    cv2.circle(picture, (int(x), int(y)), 5 * thick, _CENTRE, thick, cv2.LINE_AA)
    return np.asarray(picture, dtype=np.uint8)


def overlay_webp(photo: Photo, measurement: BeadMeasurement) -> tuple[bytes, int, int]:
    """The overlay as WebP, with its width and height in px."""
    picture = overlay(photo, measurement)
    done, data = cv2.imencode(".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, 82])
    if not done:
        raise ValueError("the overlay cannot be encoded")
    return data.tobytes(), picture.shape[1], picture.shape[0]


def _line(picture: NDArray[np.uint8], points: Points, colour: tuple[int, ...], thick: int) -> None:
    whole = np.rint(points * 16).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(picture, [whole], False, colour, thick, cv2.LINE_AA, shift=4)


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and stop (exclusive) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
