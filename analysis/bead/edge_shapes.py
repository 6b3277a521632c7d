"""Profiles across a toe: a blurred step with shading and a dark line beside it, and their fit.

For each shift of the edge a profile is projected on a small subspace; the shift that captures
most of it wins. The level is part of every subspace, so it is taken out of profiles and bases once.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from . import loops
from .loops import loaded

Floats = NDArray[np.float64]
Profiles = NDArray[np.floating[Any]]
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
"""What lies beside the step, by name; each after the one that it adds its last part to."""
_LINES_PX = {"line": 1.2, "broad line": 2.5}
"""Distance of a dark line from the edge, which is also its standard deviation."""
_RESOLVED = 2.0
"""Blur, in distances of a line, up to which it can be told from a shift."""
_PARAMETERS = {"ramps": 2, "curves": 2, "line": 1, "broad line": 1}
_STEP = 0.125
_COARSE = 0.25
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
        return _size(self)


@cache
def _weight(window: Window) -> Floats:
    at = window.columns
    share = np.where(at < 0, -at / (window.outside + 1), at / (window.inside + 1))
    fall = np.clip((share - 0.6) / 0.4, 0, 1)
    return np.asarray(0.55 + 0.45 * np.cos(np.pi * fall))


@cache
def _size(window: Window) -> float:
    weight = _weight(window)
    return float(weight @ weight)


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


def step_at(z: Floats, blur: float | Floats) -> Floats:
    """A step of height 1 at z = 0, blurred by a Gaussian."""
    return np.asarray(0.5 * (1 + erf(z / (np.sqrt(2) * blur))))


def basis(z: Floats, model: str, blur: float | Floats) -> Floats:
    """The model's parts at distances z inside of the edge, (..., k): level, step and the rest."""
    step = step_at(z, blur)
    bell = np.exp(-0.5 * (z / blur) ** 2) / (np.sqrt(2 * np.pi) * blur)
    parts = [np.ones_like(step), step]
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


def _line(z: Floats, away: float, blur: float | Floats) -> Floats:
    """A blurred Gaussian line on the plate, `away` from the edge and as broad, that ends there."""
    variance = away * away + blur * blur
    middle = (z * away * away - away * blur * blur) / variance
    spread = away * blur / np.sqrt(variance)
    return np.asarray(np.exp(-0.5 * (z + away) ** 2 / variance) * (1 - step_at(middle, spread)))


def _shifts_within(reach: float, step: float) -> Floats:
    return np.arange(-reach, reach + 1e-9, step)


def level_weighted(profiles: Profiles, window: Window) -> Projected:
    """Weighted profiles (rows, window) without their level."""
    weight = window.weight
    level = profiles @ (weight * weight) / window.size
    return np.asarray((profiles - level[:, None]) * weight, dtype=np.float32)


@dataclass(frozen=True, slots=True)
class Subspaces:
    """What models span at each shift and blur of a step, weighted by a window.

    `added` (parts, shifts x blurs, window) are the orthonormal directions that the last part of
    each model adds to those of the model without it, which must come before it. `heights`
    (models, shifts, blurs, window) read the height of a model's step off a weighted profile.
    """

    models: tuple[str, ...]
    shifts: Floats
    blurs: tuple[float, ...]
    added: Projected
    heights: Projected

    def energies(self, weighted: Projected) -> Projected:
        """Energy of profiles without level that models capture, (models, shifts, blurs, rows)."""
        squares = self.added.reshape(-1, self.added.shape[2]) @ weighted.T
        squares = np.square(squares, out=squares).reshape(len(self.added), -1)
        found = np.empty((len(self.models), squares.shape[1]), dtype=np.float32)
        rows = {MODELS[model]: row for row, model in enumerate(self.models)}
        first = 0
        for model, own in zip(self.models, found, strict=True):
            parts, last = MODELS[model], first + _added(model)
            squares[first:last].sum(axis=0, out=own)
            if parts:
                own += found[rows[parts[:-1]]]
            first = last
        return found.reshape(len(found), len(self.shifts), len(self.blurs), -1)


@cache
def subspaces(
    window: Window, models: tuple[str, ...], blurs: tuple[float, ...], reach: float
) -> Subspaces:
    """The subspaces of models within `reach` columns."""
    shifts = _shifts_within(reach, _COARSE)
    at = window.columns - shifts[:, None, None]
    added, heights = [], []
    for model in models:
        bases = basis(at, model, np.array(blurs)[:, None]) * window.weight[:, None]
        directions, sizes = np.linalg.qr(bases)
        last = np.moveaxis(directions[..., -_added(model) :], -1, 0)
        added.append(last.reshape(len(last), -1, len(window.columns)))
        heights.append(np.einsum("...nk,...k->...n", directions, np.linalg.inv(sizes)[..., 1, :]))
    added32, heights32 = np.concatenate(added).astype(np.float32), np.array(heights, np.float32)
    return Subspaces(models, shifts, blurs, added32, heights32)


def _added(model: str) -> int:
    """How many parameters a model's last part adds."""
    return _PARAMETERS[MODELS[model][-1]] if MODELS[model] else 1


@dataclass(frozen=True, slots=True)
class Ruler:
    """What measures the shift of a step in profiles with noise.

    `white` (window, window) evens the noise and takes the level out, `steps` (window, shifts)
    are the unit directions of a step in what it leaves.
    """

    white: Projected
    steps: Projected
    shifts: Floats

    @classmethod
    def of(cls, white: Floats, window: Window, blur: float, reach: float) -> "Ruler":
        """A ruler for steps with a blur within `reach` columns, by what evens the noise."""
        level = white.sum(axis=1)
        white = white - np.outer(level, level @ white) / (level @ level)
        shifts = _shifts_within(reach, _STEP)
        steps = white @ step_at(window.columns[:, None] - shifts, blur)
        steps /= np.linalg.norm(steps, axis=0)
        return cls(white.T.astype(np.float32), steps.astype(np.float32), shifts)

    def places(self, profiles: Profiles) -> Fit:
        """The best shift of each profile (..., rows, window), by captured energy.

        A step that falls towards the bead captures nothing.
        """
        weighted = profiles @ self.white
        captured = np.maximum(weighted @ self.steps, 0)
        places, most, curvature = _vertices(captured, self.shifts, power=2)
        misfit = np.maximum(np.einsum("...n,...n->...", weighted, weighted) - most, 1e-9)
        return Fit(places, misfit, _STEP**2 / (-0.5 * curvature))


@cache
def even_ruler(window: Window, blur: float, reach: float) -> Ruler:
    """A ruler for profiles whose columns are equally noisy, weighted by the window."""
    return Ruler.of(np.diag(window.weight), window, blur, reach)


def peak(energy: Projected, shifts: Floats) -> tuple[Floats, Floats, Floats]:
    """Shift (last axis) of the most energy, that energy, its (negative) second difference."""
    return _vertices(energy, shifts, power=1)


def _vertices(values: Profiles, shifts: Floats, power: int) -> tuple[Floats, Floats, Floats]:
    """Parabolas through the highest values along the last axis and those beside them.

    Of their `power`: where their vertex is, the highest value, their (negative) second difference.
    """
    flat = np.ascontiguousarray(values).reshape(-1, values.shape[-1])
    found = (loaded(loops.vertices) or _vertices_of)(flat, shifts, power)
    place, most, curvature = (one.reshape(values.shape[:-1]) for one in found)
    return place, most, curvature


def _vertices_of(values: Profiles, shifts: Floats, power: int) -> tuple[Floats, Floats, Floats]:
    """As `_vertices`, of values (n, shifts)."""
    count, last = values.shape
    at = np.minimum(np.maximum(np.argmax(values, axis=1), 1), last - 2)
    flat = at + np.arange(count) * last
    a, b, c = np.array([values.take(flat + k) for k in (-1, 0, 1)], dtype=np.float64) ** power
    curvature = np.minimum(a - 2 * b + c, -1e-9)
    move = np.minimum(np.maximum(0.5 * (a - c) / curvature, -1), 1) * (shifts[1] - shifts[0])
    return shifts[at] + move, b, curvature


def middle(values: Profiles) -> Floats:
    """Median over the last axis; to sort short rows takes a fraction of NumPy's own median."""
    ordered, count = np.sort(values, axis=-1), values.shape[-1]
    return np.asarray((ordered[..., (count - 1) // 2] + ordered[..., count // 2]) / 2)
