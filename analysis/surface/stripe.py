"""The laser stripe in a frame: one place per column, below a pixel, past gleams and ghosts.

Matched filter and dynamic programming: what looks like the stripe's cross-section counts no more
the brighter it is, so a gleam beside the stripe cannot win against the stripe's own course.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

Grid = NDArray[np.float32]
Floats = NDArray[np.float64]

_WIDTHS_PX = (1.2, 2.0, 3.2, 5.0)
"""Standard deviations of the stripe's cross-section that are tried."""
_ALONG_PX = 1.5
_STEEPEST_PX = 4
_BEND = 0.08
"""Cost of one px from column to column, against the response of a clear stripe."""
_JUMP = 15.0
"""Cost of a jump of any size, as between plates of different height, in columns of clear stripe."""
_CLEAR = 0.35
"""Part of the usual response from which on a place is as likely as any brighter one."""
_SEEN = 5.0
"""Response against its noise from which on the stripe is seen."""
_LEAST_PART = 0.5


@dataclass(frozen=True, slots=True)
class Stripe:
    """Points of the stripe in px of the frame, shape (n, 2), and which were seen clearly."""

    px: Floats
    seen: NDArray[np.bool_]


def find_stripe(pixels: NDArray[Any], name: str = "frame") -> Stripe:
    """The stripe in a frame, across it from left to right or from top to bottom.

    Raises `EvidenceError` where no stripe crosses at least half of the frame.
    """
    light = _light(pixels)
    trials = [_traced(light), _traced(np.ascontiguousarray(light.T))]
    row, seen, strength = max(trials, key=lambda trial: trial[2])
    if float(seen.mean()) < _LEAST_PART:
        raise EvidenceError(
            f"{name}: no laser stripe crosses the frame (seen in {100 * seen.mean():.0f} % of it); "
            "darken the scene or shorten the exposure"
        )
    along = np.arange(len(row), dtype=np.float64)
    upright = strength == trials[0][2]
    return Stripe(np.column_stack([along, row] if upright else [row, along]), seen)


def _light(pixels: NDArray[Any]) -> Grid:
    """Brightness 0-255; of colours the one in which the frame is brightest."""
    scale = 1 / 257 if pixels.dtype == np.uint16 else 1.0
    values = np.asarray(pixels, dtype=np.float32) * np.float32(scale)
    return values if values.ndim == 2 else np.ascontiguousarray(values[..., :3].max(axis=2))


def _traced(light: Grid) -> tuple[Floats, NDArray[np.bool_], float]:
    """Row per column, whether it was seen, and how clear the stripe is as a whole."""
    responses = [_response(light, width) for width in _WIDTHS_PX]
    clear = [float(np.median(response.max(axis=0))) for response in responses]
    response = responses[int(np.argmax(clear))]
    noise = 1.4826 * float(np.median(np.abs(response - np.median(response)))) + 0.3
    usual = max(float(np.median(response.max(axis=0))), noise)
    path = _best_path(np.clip(response / (_CLEAR * usual), 0.0, 1.0))
    columns = np.arange(response.shape[1])
    strength = response[path, columns]
    seen = strength > np.maximum(_SEEN * noise, 0.15 * usual)
    return _below_a_pixel(response, path), seen, float(np.mean(seen) * np.median(strength) / noise)


def _response(light: Grid, width_px: float) -> Grid:
    """Likeness to a bright line of this width along the rows, its surroundings taken off."""
    along = np.asarray(cv2.GaussianBlur(light, (0, 0), sigmaX=_ALONG_PX, sigmaY=0.01))
    inner = cv2.GaussianBlur(along, (0, 0), sigmaX=0.01, sigmaY=width_px)
    outer = cv2.GaussianBlur(along, (0, 0), sigmaX=0.01, sigmaY=2.5 * width_px)
    return np.asarray(2.0 * (inner - outer), dtype=np.float32)


def _best_path(likeness: Grid) -> NDArray[np.intp]:
    """Row per column with the most likeness in all, by dynamic programming over columns.

    A step costs by its size up to `_STEEPEST_PX`; a jump of any size costs the same.
    """
    rows, columns = likeness.shape
    total = likeness[:, 0].copy()
    steps = np.arange(-_STEEPEST_PX, _STEEPEST_PX + 1)
    cost = (_BEND * np.abs(steps)).astype(np.float32)
    origin = np.empty((columns, rows), dtype=np.int32)
    index = np.arange(rows, dtype=np.int32)
    for column in range(1, columns):
        padded = np.pad(total, _STEEPEST_PX, constant_values=-np.inf)
        windows = np.lib.stride_tricks.sliding_window_view(padded, len(steps))
        gains = windows - cost
        choice = np.argmax(gains, axis=1)
        best = gains[index, choice]
        leap = int(np.argmax(total))
        jumped = total[leap] - _JUMP > best
        origin[column] = np.where(jumped, leap, index + steps[choice])
        total = np.where(jumped, total[leap] - _JUMP, best) + likeness[:, column]
    path = np.empty(columns, dtype=np.intp)
    path[-1] = int(np.argmax(total))
    for column in range(columns - 1, 0, -1):
        path[column - 1] = origin[column, path[column]]
    return path


def _below_a_pixel(response: Grid, path: NDArray[np.intp]) -> Floats:
    """The peak of a parabola through the response around the path."""
    columns = np.arange(len(path))
    middle = np.clip(path, 1, response.shape[0] - 2)
    for _ in range(3):
        near = response[middle + np.array([[-1], [0], [1]]), columns]
        middle = np.clip(middle + np.argmax(near, axis=0) - 1, 1, response.shape[0] - 2)
    above, here, below = (response[middle + k, columns].astype(np.float64) for k in (-1, 0, 1))
    bend = above - 2 * here + below
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0, 0.5 * (above - below) / bend, 0.0)
    return np.asarray(middle + np.clip(shift, -1.0, 1.0))
