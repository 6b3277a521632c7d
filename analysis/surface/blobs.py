"""Closed blobs of a picture, bright or dark, told from streaks, edges and texture.

Candidates are extrema of differences of Gaussians over several sizes against the scatter of the
same response around them. Each is then looked at in rays from its middle: a drop differs from its
surroundings in every direction, a streak or an edge does not.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Grid = NDArray[np.float32]
Floats = NDArray[np.float64]

_RATIO = 1.3
"""Of one size to the next."""
_SURROUND = 2.2
"""Width of the surrounding Gaussian against the inner one."""
_LEAST_SCORE = 5.0
_RAYS = 16
_STEPS = 24
_REACH = 3.0
_CLOSED = 0.35
"""Part of the contrast that a blob keeps in its weakest direction."""
_SHADOW = 1.4
"""A gleam and its shadow lie this near to each other, in their radii together."""
_FEWEST_PAIRS = 4
_ONE_LIGHT = 0.7
"""Length of the mean direction from gleam to shadow from which on there is one light."""
_ABOVE_TEXTURE = 3.0
"""Contrast against the scatter of the surroundings."""


@dataclass(frozen=True, slots=True)
class Blobs:
    """Blobs of a picture, arrays of one length: middle and radius in px, contrast, score.

    `contrast` is signed (bright positive), in grey levels; `score` counts standard deviations.
    """

    x_px: Floats
    y_px: Floats
    radius_px: Floats
    contrast: Floats
    score: Floats

    def __len__(self) -> int:
        return len(self.x_px)

    def chosen(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> "Blobs":
        """Some of the blobs."""
        return Blobs(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


def find_blobs(
    light: Grid, inside: NDArray[np.bool_], smallest_px: float, largest_px: float
) -> Blobs:
    """Blobs with radii from `smallest_px` to `largest_px` where `inside` is True.

    `light` has shape (rows, columns), in grey levels; what lies outside counts for nothing.
    """
    factor = max(1.0, smallest_px / 2.0)
    if factor > 1.0:
        size = (max(1, round(light.shape[1] / factor)), max(1, round(light.shape[0] / factor)))
        light = np.asarray(cv2.resize(light, size, interpolation=cv2.INTER_AREA))
        small = cv2.resize(inside.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        inside = np.asarray(small) > 0.999
    found = _find(light, inside, smallest_px / factor, largest_px / factor)
    return Blobs(
        (found.x_px + 0.5) * factor - 0.5,
        (found.y_px + 0.5) * factor - 0.5,
        found.radius_px * factor,
        found.contrast,
        found.score,
    )


def _find(light: Grid, inside: NDArray[np.bool_], smallest: float, largest: float) -> Blobs:
    mask = inside.astype(np.float32)
    candidates = []
    radius = smallest
    while radius <= largest * 1.01:
        candidates.append(_candidates(light, mask, radius))
        radius *= _RATIO
    rows = np.concatenate(candidates)
    rows = rows[np.argsort(-rows[:, 3], kind="stable")]
    seen = _looked_at(light, mask, rows[_apart(rows)])
    return _separate(seen)


def _blurred(values: Grid, mask: Grid, sigma: float) -> tuple[Grid, Grid]:
    """Gaussian mean over the mask, and the mask's own part."""
    part = np.asarray(cv2.GaussianBlur(mask, (0, 0), sigma), dtype=np.float32)
    total = np.asarray(cv2.GaussianBlur(values * mask, (0, 0), sigma))
    return np.asarray(total / np.maximum(part, 1e-3), dtype=np.float32), part


def _candidates(light: Grid, mask: Grid, radius: float) -> Floats:
    """Rows x, y, radius, score of the extrema at one size."""
    inner, part = _blurred(light, mask, 0.6 * radius)
    around, wide = _blurred(light, mask, 0.6 * radius * _SURROUND)
    response = (inner - around) * (part > 0.5) * (wide > 0.3)
    score = np.abs(response) / _scatter(response, mask, radius)
    score[mask == 0] = 0
    reach = 2 * int(max(1, radius)) + 1
    peaks = score >= np.asarray(cv2.dilate(score, np.ones((reach, reach), np.uint8)))
    y, x = np.nonzero(peaks & (score > _LEAST_SCORE))
    return np.column_stack([x, y, np.full(len(x), radius), score[y, x]]).astype(np.float64)


def _scatter(response: Grid, mask: Grid, radius: float) -> Grid:
    """Robust local standard deviation: large responses are cut, so that blobs do not count.

    It is smooth, so it is found at a quarter of its own width.
    """
    known = mask > 0
    if not known.any():
        return np.ones_like(response)
    usual = 1.4826 * float(np.median(np.abs(response[known]))) + 0.15
    reach = 12.0 * radius + 8.0
    size = tuple(max(1, round(4 * count / reach)) for count in response.shape[::-1])
    part = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA))
    square = np.minimum(response**2, (3.0 * usual) ** 2)
    for _ in range(3):
        mean = np.asarray(cv2.resize(square * mask, size, interpolation=cv2.INTER_AREA))
        mean = np.asarray(cv2.GaussianBlur(mean, (0, 0), 4.0))
        mean = mean / np.maximum(cv2.GaussianBlur(part, (0, 0), 4.0), 1e-3)
        local = cv2.resize(mean, response.shape[::-1], interpolation=cv2.INTER_LINEAR)
        square = np.minimum(response**2, 9.0 * np.asarray(local))
    return np.asarray(np.maximum(np.sqrt(1.1 * local), 0.3 * usual), dtype=np.float32)


def _apart(rows: Floats) -> list[int]:
    """Candidates in order of score, without those within another's radius."""
    kept: list[int] = []
    for index, (x, y, radius, _) in enumerate(rows):
        near = rows[kept]
        far = np.hypot(near[:, 0] - x, near[:, 1] - y)
        if (far > 0.6 * np.maximum(near[:, 2], radius)).all():
            kept.append(index)
    return kept


def _looked_at(light: Grid, mask: Grid, rows: Floats) -> Blobs:
    """Candidates that are closed: contrast in every direction, radius where it is half."""
    if not len(rows):
        return Blobs(*(np.empty(0) for _ in range(5)))
    x, y, radius, score = rows.T
    angle = 2 * np.pi * np.arange(_RAYS) / _RAYS
    place = (np.arange(_STEPS) + 0.5) / _STEPS * _REACH
    away = radius[:, None, None] * place[None, None, :]
    at_x = (x[:, None, None] + away * np.cos(angle)[None, :, None]).astype(np.float32)
    at_y = (y[:, None, None] + away * np.sin(angle)[None, :, None]).astype(np.float32)
    shape = (len(x), _RAYS * _STEPS)
    rays = _sampled(light, at_x.reshape(shape), at_y.reshape(shape)).reshape(at_x.shape)
    known = _sampled(mask, at_x.reshape(shape), at_y.reshape(shape)).reshape(at_x.shape) > 0.9
    rays = np.where(known, rays, np.nan)
    core = np.nanmean(rays[:, :, place < 0.5].reshape(len(x), -1), axis=1)
    ring = (place > 1.6) & (place < 2.6)
    around = rays[:, :, ring]
    with np.errstate(invalid="ignore"):
        sides = _mean(around, axis=2)
        level = _median(sides)
        contrast = core - level
        kept = np.sign(contrast)[:, None] * (core[:, None] - sides) / np.abs(contrast)[:, None]
        closed = np.nanmin(np.where(np.isfinite(kept), kept, np.inf), axis=1)
        seen = np.isfinite(sides).mean(axis=1)
        texture = np.sqrt(_mean((around - sides[:, :, None]).reshape(len(x), -1) ** 2, axis=1))
    good = (closed > _CLOSED) & (seen > 0.6) & (np.abs(contrast) > _ABOVE_TEXTURE * texture)
    half = _half_radius(rays, core, level, place) * radius
    return Blobs(x, y, half, contrast, score).chosen(good & (half > 0))


def _mean(values: NDArray[np.floating], axis: int) -> Floats:
    count = np.isfinite(values).sum(axis=axis)
    total = np.nansum(values, axis=axis)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan), dtype=np.float64)


def _median(sides: Floats) -> Floats:
    some = np.isfinite(sides).any(axis=1)
    result = np.full(len(sides), np.nan)
    result[some] = np.nanmedian(sides[some], axis=1)
    return result


def _sampled(values: Grid, x: Grid, y: Grid) -> Grid:
    return np.asarray(
        cv2.remap(values, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
    )


def _half_radius(rays: NDArray[np.floating], core: Floats, level: Floats, place: Floats) -> Floats:
    """Where the mean over all directions has lost half its contrast, in candidate radii."""
    profile = _mean(np.swapaxes(rays, 1, 2), axis=2)
    # Without contrast there is no half of it: NaN, which is not below.
    with np.errstate(invalid="ignore", divide="ignore"):
        left = (profile - level[:, None]) / (core - level)[:, None]
    below = left < 0.5
    first = np.argmax(below, axis=1)
    return np.where(below.any(axis=1), place[first], 0.0)


def _separate(blobs: Blobs) -> Blobs:
    """Of blobs that lie in each other the better one; a gleam and its shadow as one drop."""
    kept: list[int] = []
    for index in np.argsort(-blobs.score, kind="stable"):
        near = np.array(kept, dtype=np.intp)
        far = np.hypot(blobs.x_px[near] - blobs.x_px[index], blobs.y_px[near] - blobs.y_px[index])
        if (far > 0.8 * np.maximum(blobs.radius_px[near], blobs.radius_px[index])).all():
            kept.append(int(index))
    return _lit_drops(blobs.chosen(np.array(kept, dtype=np.intp)))


def _lit_drops(blobs: Blobs) -> Blobs:
    """Gleam and shadow of a drop become one blob where the light comes from one side.

    Bright and dark marks side by side are pairs by chance unless most pairs point the same way.
    """
    x, y, radius = blobs.x_px.copy(), blobs.y_px.copy(), blobs.radius_px.copy()
    pairs = _pairs(blobs)
    if len(pairs) < _FEWEST_PAIRS:
        return blobs
    gleam, shadow = pairs.T
    heading = np.arctan2(y[shadow] - y[gleam], x[shadow] - x[gleam])
    together = np.exp(1j * heading).mean()
    if abs(together) < _ONE_LIGHT:
        return blobs
    gone = np.zeros(len(blobs), dtype=bool)
    for bright, dark, angle in zip(gleam, shadow, heading, strict=True):
        if np.cos(angle - np.angle(together)) > 0.7 and not gone[[bright, dark]].any():
            first, second = (
                (bright, dark) if blobs.score[bright] >= blobs.score[dark] else (dark, bright)
            )
            _grow(x, y, radius, int(first), int(second))
            gone[second] = True
    return Blobs(x, y, radius, blobs.contrast, blobs.score).chosen(~gone)


def _pairs(blobs: Blobs) -> NDArray[np.intp]:
    """Bright and dark blobs that touch, nearest first, shape (n, 2)."""
    bright, dark = np.flatnonzero(blobs.contrast > 0), np.flatnonzero(blobs.contrast < 0)
    apart_x = blobs.x_px[bright][:, None] - blobs.x_px[dark]
    apart_y = blobs.y_px[bright][:, None] - blobs.y_px[dark]
    far = np.hypot(apart_x, apart_y)
    reach = blobs.radius_px[bright][:, None] + blobs.radius_px[dark]
    first, second = np.nonzero(far < _SHADOW * reach)
    order = np.argsort(far[first, second], kind="stable")
    return np.column_stack([bright[first], dark[second]])[order]


def _grow(x: Floats, y: Floats, radius: Floats, drop: int, more: int) -> None:
    """Make `drop` the circle around both, unless it holds the other already."""
    far = float(np.hypot(x[more] - x[drop], y[more] - y[drop]))
    whole = (far + radius[drop] + radius[more]) / 2
    if whole <= radius[drop] or far == 0:
        return
    step = (whole - radius[drop]) / far
    x[drop] += step * (x[more] - x[drop])
    y[drop] += step * (y[more] - y[drop])
    radius[drop] = whole
