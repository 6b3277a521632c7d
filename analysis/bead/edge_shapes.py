"""Profiles across a toe: a blurred step with shading and a dark line beside it, and their fit.

For each shift of the edge a profile is projected on a small subspace; the shift that captures
most of it wins.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Floats = NDArray[np.float64]
Projected = NDArray[np.float32]
"""Profiles and bases to be multiplied: what a fit leaves is a ten-thousandth of them or more."""

MODELS: dict[str, tuple[str, ...]] = {
    "step": (),
    "line": ("line",),
    "broad line": ("broad line",),
    "ramps": ("ramps",),
    "ramps, line": ("ramps", "line"),
    "curves": ("ramps", "curves"),
    "curves, line": ("ramps", "curves", "line"),
    "curves, broad line": ("ramps", "curves", "broad line"),
}
"""What lies beside the step, by name."""
_LINES_PX = {"line": 1.2, "broad line": 2.5}
"""Distance of a dark line from the edge, which is also its standard deviation."""
_RESOLVED = 2.0
"""Blur, in distances of a line, up to which it can be told from a shift."""
_PARAMETERS = {"line": 1, "broad line": 1, "ramps": 2, "curves": 2}
_STEP = 0.125
COARSE = 0.25
"""Columns from one shift to the next in fits, and where only models are compared."""


@dataclass(frozen=True, slots=True)
class Window:
    """Columns around an edge that are looked at: `outside` of them on the plate, `inside` bead."""

    outside: int
    inside: int

    def around(self, blur: float) -> "Window":
        """The part that an edge of this blur needs, so that little else is in it."""
        return Window(
            min(self.outside, max(8, int(6 * blur) + 4)),
            min(self.inside, max(6, int(5 * blur) + 3)),
        )

    @property
    def columns(self) -> Floats:
        """Distance of each column from the edge, the bead towards larger ones."""
        return np.arange(-self.outside, self.inside + 1, dtype=np.float64)

    @property
    def weight(self) -> Floats:
        """1 near the edge, falling to a tenth at the borders."""
        return _weight(self)

    @property
    def size(self) -> float:
        """Columns, each counted by the square of its weight."""
        return float(self.weight @ self.weight)


@cache
def _weight(window: Window) -> Floats:
    at = window.columns
    share = np.where(at < 0, -at / (window.outside + 1), at / (window.inside + 1))
    fall = np.clip((share - 0.6) / 0.4, 0, 1)
    return np.asarray(0.55 + 0.45 * np.cos(np.pi * fall))


@dataclass(frozen=True, slots=True)
class Fit:
    """A model at each row: shift, mean square misfit and variance of the shift for unit noise."""

    shift: Floats
    misfit: Floats
    variance: Floats


def parameters(model: str) -> int:
    """How many levels and slopes a model has, its place left out."""
    return 2 + sum(_PARAMETERS[part] for part in MODELS[model])


def resolved(model: str, blur: float) -> bool:
    """Whether a blur leaves enough of a model's line to tell it from a shift of the edge."""
    return all(blur <= _RESOLVED * _LINES_PX.get(part, np.inf) for part in MODELS[model])


def step_at(z: Floats, blur: float) -> Floats:
    """A step of height 1 at z = 0, blurred by a Gaussian."""
    return np.asarray(0.5 * (1 + erf(z / (np.sqrt(2) * blur))))


def basis(z: Floats, model: str, blur: float) -> Floats:
    """The model's parts at distances z inside of the edge, (..., k): level, step and the rest."""
    step = step_at(z, blur)
    bell = np.exp(-0.5 * (z / blur) ** 2) / (np.sqrt(2 * np.pi) * blur)
    parts = [np.ones_like(z), step]
    for part in MODELS[model]:
        if part in _LINES_PX:
            parts.append(_line(z, _LINES_PX[part], blur))
            continue
        inner, whole = z * step + blur * blur * bell, z
        if part == "curves":
            inner = (z * z + blur * blur) * step + z * blur * blur * bell
            whole = z * z + blur * blur
        parts += [inner, whole - inner]
    return np.stack(parts, axis=-1)


def _line(z: Floats, away: float, blur: float) -> Floats:
    """A blurred Gaussian line on the plate, `away` from the edge and as broad, that ends there."""
    variance = away * away + blur * blur
    middle = (z * away * away - away * blur * blur) / variance
    spread = away * blur / np.sqrt(variance)
    return np.exp(-0.5 * (z + away) ** 2 / variance) * (1 - step_at(middle, float(spread)))


def shifts_within(reach: float, step: float = _STEP) -> Floats:
    """The shifts that are tried, in columns."""
    return np.arange(-reach, reach + 1e-9, step)


@cache
def subspaces(
    window: Window, model: str, blurs: tuple[float, ...], reach: float, step: float = _STEP
) -> Projected:
    """Orthonormal bases of the weighted profiles side by side.

    Shape (window, k x blurs x shifts), the last index fastest.
    """
    at = window.columns - shifts_within(reach, step)[:, None]
    stacked = np.concatenate([basis(at, model, blur) for blur in blurs])
    return side_by_side(stacked * window.weight[None, :, None])


def side_by_side(stacked: Floats) -> Projected:
    """Orthonormal bases of a stack (n, window, k), as (window, k x n), each in its own sense."""
    bases, sizes = np.linalg.qr(stacked)
    bases = bases * np.sign(np.diagonal(sizes, axis1=1, axis2=2))[:, None, :]
    return np.asarray(bases.transpose(1, 2, 0).reshape(stacked.shape[1], -1), dtype=np.float32)


def fit(profiles: Floats, window: Window, model: str, blur: float, reach: float) -> Fit:
    """The best shift of each profile within `reach` columns, by captured energy."""
    weighted = level_weighted(profiles, window)
    return best_shifts(weighted, subspaces(window, model, (blur,), reach), shifts_within(reach))


def level_weighted(profiles: Floats, window: Window) -> Projected:
    """Profiles without their mean, weighted; every model has a level."""
    level = profiles.mean(axis=1, keepdims=True)
    return np.asarray((profiles - level) * window.weight, dtype=np.float32)


def best_shifts(weighted: Projected, bases: Projected, shifts: Floats) -> Fit:
    """The shift at which the bases (window, k x shifts) capture most of each weighted profile.

    A step that falls towards the bead captures nothing.
    """
    projected = (weighted @ bases).reshape(len(weighted), -1, len(shifts))
    captured = energy(projected)
    captured[projected[:, 1] <= 0] = 0.0
    places, most, curvature = peak(captured, shifts)
    misfit = np.maximum(np.einsum("rn,rn->r", weighted, weighted) - most, 1e-9)
    return Fit(places, misfit, _STEP**2 / (-0.5 * curvature))


def energy(projected: Projected) -> Projected:
    """Sum of squares over the middle axis."""
    return np.asarray(np.einsum("rkn,rkn->rn", projected, projected), dtype=np.float32)


def peak(captured: Projected, shifts: Floats) -> tuple[Floats, Floats, Floats]:
    """Shift of each row's most captured energy, that energy, its (negative) second difference."""
    at = np.clip(np.argmax(captured, axis=1), 1, len(shifts) - 2)
    a, b, c = (captured[np.arange(len(at)), at + k].astype(np.float64) for k in (-1, 0, 1))
    curvature = np.minimum(a - 2 * b + c, -1e-9)
    step = shifts[1] - shifts[0]
    return shifts[at] + np.clip(0.5 * (a - c) / curvature, -1, 1) * step, b, curvature
