"""Sub-pixel place of a toe: matched subspaces of a blurred step with shading, chosen by evidence.

For each shift of the edge the profile across the toe is projected on a small subspace (constant,
blurred step, ramps on both sides, a dark line outside); the shift that captures most of it wins.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Floats = NDArray[np.float64]

_BLURS_PX = tuple(float(blur) for blur in np.geomspace(0.7, 4.6, 8))
_MODELS = ("step", "line", "ramps", "ramps and line")
_SHIFT = 0.125
_RANGE = 2.5
_SHIFTS = np.arange(-_RANGE, _RANGE + 1e-9, _SHIFT)
_GREY_FLOOR = 0.03
"""Variance in grey levels that any picture has: rounding to 8 bit."""
_PRICE = 0.1
"""How much lower (log) the misfit must be for each step to a richer model."""


@dataclass(frozen=True, slots=True)
class EdgePlaces:
    """Per row: column of the edge, its random standard uncertainty, its height, and the spread.

    `between_models` is the distance (columns) between the plain step's and the chosen model's
    answer, per row; `model` and `blur_px` say what was chosen.
    """

    column: Floats
    u: Floats
    height: Floats
    between_models: Floats
    model: str
    blur_px: float


@dataclass(frozen=True, slots=True)
class _Fit:
    column: Floats
    residual: Floats
    variance: Floats
    freedom: int


def locate_edges(signal: NDArray[np.float32], near: Floats, side: int) -> EdgePlaces:
    """Refine edges of `signal` (rows, columns) that lie within about two columns of `near`.

    The bead lies towards smaller columns for `side` 1, towards larger for -1.
    """
    model, blur = _choose(signal, near, side)
    chosen, plain = (_fit(signal, near, side, name, blur) for name in (model, "step"))
    height = _height(signal, chosen.column, side, blur)
    sigma = np.sqrt(chosen.residual / chosen.freedom)
    u = np.sqrt(np.maximum(chosen.variance, 1e-12)) * _smoothed(sigma)
    between = np.abs(chosen.column - plain.column)
    return EdgePlaces(chosen.column, u, height, between, model, blur)


def _choose(signal: NDArray[np.float32], near: Floats, side: int) -> tuple[str, float]:
    """Model and blur with the best balance of misfit and freedom, on some of the rows."""
    every = max(1, len(near) // 150)
    some, there = signal[::every], near[::every]

    def misfit(model: str, blur: float) -> float:
        fit = _fit(some, there, side, model, blur)
        return float(np.log(np.median(fit.residual) / fit.freedom + _GREY_FLOOR))

    found = []
    for richness, model in enumerate(_MODELS):
        logs = [misfit(model, blur) for blur in _BLURS_PX]
        blur = _lowest(logs)
        found.append((min(*logs, misfit(model, blur)) + _PRICE * richness, model, blur))
    _, model, blur = min(found)
    return model, blur


def _lowest(misfits: Sequence[float]) -> float:
    """Blur at the lowest misfit, by a parabola over the geometric grid."""
    at = int(np.clip(np.argmin(misfits), 1, len(misfits) - 2))
    a, b, c = misfits[at - 1 : at + 2]
    move = float(np.clip(0.5 * (a - c) / max(a - 2 * b + c, 1e-9), -1, 1))
    return round(float(_BLURS_PX[at] * (_BLURS_PX[1] / _BLURS_PX[0]) ** move), 2)


def _window() -> tuple[Floats, Floats]:
    """Columns around an edge that are looked at, and their weights."""
    half = int(np.ceil(3.0 * max(_BLURS_PX) + _RANGE)) + 2
    at = np.arange(-half, half + 1, dtype=np.float64)
    return at, np.exp(-0.5 * (at / (half / 2.0)) ** 2)


def _basis(at: Floats, shift: float, model: str, blur: float) -> Floats:
    """Orthonormal columns that span the model's profiles; the bead lies towards larger `at`."""
    z = at - shift
    step = 0.5 * (1 + erf(z / (np.sqrt(2) * blur)))
    bell = np.exp(-0.5 * (z / blur) ** 2) / (np.sqrt(2 * np.pi) * blur)
    parts = [np.ones_like(z), step]
    if "ramps" in model:
        inner = z * step + blur * blur * bell
        parts += [inner, z - inner]
    if "line" in model:
        broad = np.hypot(blur, 1.2)
        parts.append(np.exp(-0.5 * ((z + 1.2) / broad) ** 2))
    return np.asarray(np.linalg.qr(np.array(parts).T)[0])


def _fit(signal: NDArray[np.float32], near: Floats, side: int, model: str, blur: float) -> _Fit:
    at, weight = _window()
    half = len(at) // 2
    centre = np.clip(np.rint(near).astype(int), half, signal.shape[1] - 1 - half)
    rows = np.arange(len(near))[:, None]
    profile = signal[rows, centre[:, None] - side * at.astype(int)].astype(np.float64)
    profile = (profile - profile.mean(axis=1, keepdims=True)) * weight
    captured = np.stack([((profile @ q) ** 2).sum(axis=1) for q in _subspaces(model, blur)], axis=1)
    total = (profile**2).sum(axis=1)
    peak = np.clip(np.argmax(captured, axis=1), 1, len(_SHIFTS) - 2)
    a, b, c = (captured[np.arange(len(peak)), peak + k] for k in (-1, 0, 1))
    curvature = np.minimum(a - 2 * b + c, -1e-9)
    move = np.clip(0.5 * (a - c) / curvature, -1, 1)
    shift = _SHIFTS[peak] + move * _SHIFT
    residual = np.maximum(total - b, 1e-9)
    variance = 1 / (-0.5 * curvature / _SHIFT**2)
    freedom = float((weight**2).sum()) - _basis(at, 0.0, model, blur).shape[1] - 1
    return _Fit(centre - side * shift, residual, variance, max(1, int(freedom)))


@cache
def _subspaces(model: str, blur: float) -> tuple[Floats, ...]:
    """Orthonormal bases of the weighted profiles, one for each shift."""
    at, weight = _window()
    return tuple(
        np.asarray(np.linalg.qr(_basis(at, shift, model, blur) * weight[:, None])[0])
        for shift in _SHIFTS
    )


def _height(signal: NDArray[np.float32], column: Floats, side: int, blur: float) -> Floats:
    """Inside minus outside level, just beyond the blur."""
    reach = 2.0 * blur + 1
    rows = np.arange(len(column))
    inside = np.clip(np.rint(column - side * reach).astype(int), 0, signal.shape[1] - 1)
    outside = np.clip(np.rint(column + side * reach).astype(int), 0, signal.shape[1] - 1)
    return np.asarray(signal[rows, inside] - signal[rows, outside], dtype=np.float64)


def _smoothed(values: Floats) -> Floats:
    """Running mean over some rows: the noise of one row says little by itself."""
    count = min(31, len(values))
    kernel = np.ones(count) / count
    padded = np.pad(values, (count // 2, count - 1 - count // 2), mode="edge")
    return np.asarray(np.convolve(padded, kernel, mode="valid"))
