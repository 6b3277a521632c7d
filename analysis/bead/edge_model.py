"""Which model a toe needs: chosen on mean profiles over stretches of it.

Shading and lines beside a toe vary slowly along it, so they are fitted on means. Taken off, they
leave a plain step to each row, which is the least noisy thing to place.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from . import loops
from .edge_shapes import (
    MODELS,
    Floats,
    Profiles,
    Projected,
    Window,
    basis,
    even_ruler,
    level_weighted,
    middle,
    parameters,
    peak,
    resolved,
    subspaces,
)
from .loops import loaded
from .series import calmed

Rows = NDArray[np.int64]

_BLURS_PX = tuple(float(blur) for blur in np.geomspace(0.6, 5.0, 20))
_ROW_BLURS_PX = _BLURS_PX[1::2]
_SINGLE_ROWS = ("step", "line", "ramps", "ramps, line")
"""Models that a single row can carry."""
GREY_FLOOR = 0.02
"""Variance in grey levels that any mean profile has: rounding to 8 bit, the model of the blur."""
EDGE_FLOOR = 0.01
"""The same as a part of the step: no real blur is quite Gaussian."""
_CARRIES = 0.3
"""Part of the change over a toe that its step must carry, whatever lies beside it."""
_FAR = 4.0
"""Difference in score, in prices, from which on a model is out of the question."""
_LIKELY = 0.2
"""Evidence, of the best model's, that a model must have to be chosen."""
_ALIKE_PX = 0.05
"""Difference in place up to which the simpler model is taken."""
_ROWS = 512
"""Rows from which a toe's model is made at most."""
_BLOCKS = 16
_TRUST = 0.25
"""Part of what a richer model moves an edge by that stays in doubt."""
_GOLDEN = (np.sqrt(5) - 1) / 2
_CALM = 5.0
"""Rows over which single rows' places are averaged to align profiles."""


@dataclass(frozen=True, slots=True)
class EdgeModel:
    """What was chosen for a toe: model, blur, the doubt between models, and what is not step.

    `shading` (rows, window) are ramps and lines beside the step in each row's profile.
    """

    window: Window
    name: str
    blur: float
    u: float
    shading: Profiles


def profiles_at(signal: Projected, centre: Rows, window: Window) -> Projected:
    """Profiles (..., rows, window) around a column of each row, the bead to the right."""
    *stack, rows, width = signal.shape
    size = window.outside + window.inside + 1
    cut = loaded(loops.profiles) or _profiles
    found = cut(signal.reshape(-1, rows, width), centre, window.outside, size)
    return np.asarray(found).reshape(*stack, rows, size)


def _profiles(signal: Projected, centre: Rows, outside: int, size: int) -> Projected:
    """As `profiles_at`: `size` columns from `outside` before it, of (stack, rows, width)."""
    stack, rows, width = signal.shape
    columns = np.minimum(
        np.maximum(centre[:, None] + np.arange(-outside, size - outside), 0), width - 1
    )
    at = columns + (np.arange(rows) * width)[:, None]
    return np.asarray(signal.reshape(stack, -1).take(at, axis=-1))


def choose_model(signal: Projected, centre: Rows, window: Window) -> EdgeModel:
    """The model for a toe: on mean profiles of blocks of rows, aligned by a first plain fit.

    Where there is shading or a line beside the step, a narrower window keeps what is farther
    away out of it.
    """
    shift, means = _aligned(signal, centre, window)
    model, doubt = _chosen(means, window)
    near = window.around(model.blur)
    if model.name != "step" and near != window:
        window = near
        shift, means = _aligned(signal, centre, window)
        model, doubt = _chosen(means, window)
    shading = _along(_shading(means, window, model), shift)
    return EdgeModel(window, model.name, model.blur, doubt, shading)


def spread(count: int, most: int) -> Rows:
    """Some of `count` rows, spread unevenly: a ripple must not keep step with them."""
    if count <= most:
        return np.arange(count)
    at = np.arange(most)
    return np.asarray((at + at * _GOLDEN % 1.0) * count / most, dtype=np.int64)


def _aligned(signal: Projected, centre: Rows, window: Window) -> tuple[Floats, Floats]:
    """Shift of each row's edge by a plain fit, calmed along the toe, and mean profiles."""
    profiles = profiles_at(signal, centre, window)
    first = even_ruler(window, 1.5, 2.5).places(profiles).shift
    shift = calmed(first + centre, _CALM) - centre
    rows = spread(len(centre), _ROWS)
    return shift, aligned_means(profiles[rows], shift[rows])


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A model at its best blur: log misfit with the price of its parameters, place, step."""

    name: str
    blur: float
    score: float
    place: float
    step: float


def _chosen(means: Floats, window: Window) -> tuple[_Candidate, float]:
    """The likely model that would be least wrong if another one were true, and the doubt."""
    tried = _candidates(means, window)
    scores = np.array([candidate.score for candidate in tried])
    places = np.array([candidate.place for candidate in tried])
    likely = np.exp((scores.min() - scores) / _price(window))
    risks = (places[:, None] - places) ** 2 @ likely / likely.sum()
    risks[likely < _LIKELY] = np.inf
    good = np.flatnonzero(risks <= risks.min() + _ALIKE_PX**2)
    best = min(good, key=lambda one: (parameters(tried[one].name), risks[one]))
    moved_by = places[best] - places[0]
    return tried[best], float(np.hypot(np.sqrt(risks[best]), _TRUST * moved_by))


def _candidates(means: Floats, window: Window) -> list[_Candidate]:
    """The plain step, and the models that the blur lets see and whose step carries the change.

    Those that are far less likely than the best are left out.
    """
    plain, *richer = _tried(means, window)
    far = _FAR * _price(window)
    kept, best = [plain], plain.score
    for one in sorted((one for one in richer if resolved(one.name, plain.blur)), key=_by_score):
        if one.score > best + far:
            break
        if one.step > _CARRIES * plain.step:
            kept.append(one)
            best = min(best, one.score)
    return kept


def _by_score(candidate: _Candidate) -> float:
    return candidate.score


@cache
def _price(window: Window) -> float:
    """How much lower (log) the misfit must be for each further parameter (Schwarz 1978)."""
    return float(np.log(window.size)) / window.size


def _shading(means: Floats, window: Window, model: _Candidate) -> Floats:
    """What a model adds to its step in each mean profile, (blocks, window).

    Aligned profiles have one place in common: single blocks would now and then find another.
    """
    if model.name == "step":
        return np.zeros_like(means)
    parts = basis(window.columns - model.place, model.name, model.blur)
    weighted = parts * window.weight[:, None]
    found = np.linalg.lstsq(weighted, (means * window.weight).T, rcond=None)[0]
    shading = (parts[:, 2:] @ found[2:]).T
    return np.asarray(gaussian_filter1d(shading, 1.0, axis=0, mode="nearest"))


def _along(shading: Floats, shift: Floats) -> Profiles:
    """Shading of blocks of rows in each row's profile: between that of the blocks next to it."""
    rows, blocks = len(shift), len(shading)
    at = np.clip(np.linspace(0, blocks, rows) - 0.5, 0, blocks - 1)
    low = np.minimum(at.astype(np.int64), max(blocks - 2, 0))
    before, behind = shading[low], shading[np.minimum(low + 1, blocks - 1)]
    between = before + (at - low)[:, None] * (behind - before)
    return moved(between.astype(np.float32), -shift)


def aligned_means(profiles: Profiles, shift: Floats) -> Floats:
    """Means of blocks of rows, each row moved by its shift."""
    count = min(_BLOCKS, max(1, len(profiles) // 4))
    size, more = divmod(len(profiles), count)
    lengths = size + (np.arange(count) < more)
    straight = moved(profiles, shift)
    sums = np.add.reduceat(straight, np.cumsum(lengths) - lengths)
    return np.asarray(sums / lengths[:, None])


def moved(profiles: Profiles, shift: Floats) -> Profiles:
    """Profiles read `shift` columns further on (linear interpolation)."""
    machine = loaded(loops.moved)
    if machine is not None:
        return np.asarray(machine(profiles, shift))
    rows, count = profiles.shape
    whole = np.floor(shift)
    columns = np.arange(count + 1) + whole.astype(np.int64)[:, None]
    columns = np.minimum(np.maximum(columns, 0), count - 1)
    near = profiles.take(columns + (np.arange(rows) * count)[:, None])
    part = (shift - whole).astype(profiles.dtype)[:, None]
    return np.asarray(near[:, :-1] + part * (near[:, 1:] - near[:, :-1]))


def _tried(means: Floats, window: Window) -> list[_Candidate]:
    """Each model at the blur, between those that are tried, where its misfit is least."""
    weighted, models = level_weighted(means, window), tuple(MODELS)
    space = subspaces(window, models, _BLURS_PX, 1.5)
    captured = space.energies(weighted)
    floor = GREY_FLOOR + (EDGE_FLOOR * float(middle(np.ptp(means, axis=1)))) ** 2
    logs = _log_misfits(weighted, window, models, captured, floor)
    each, best = np.arange(len(models)), np.argmin(logs, axis=1)
    at = np.clip(best, 1, len(_BLURS_PX) - 2)
    a, b, c = (logs[each, at + k] for k in (-1, 0, 1))
    move = np.clip(0.5 * (a - c) / np.maximum(a - 2 * b + c, 1e-9), -1, 1)
    blurs = np.array(_BLURS_PX)[at] * (_BLURS_PX[1] / _BLURS_PX[0]) ** move
    scores = b - 0.25 * (a - c) * move
    places = middle(peak(captured[each, :, best].swapaxes(1, 2), space.shifts)[0])
    nearest = np.searchsorted(space.shifts[:-1] + space.shifts[1:], 2 * places)
    steps = space.heights[each, nearest, best] @ weighted.mean(axis=0)
    found = zip(models, *np.array([blurs.round(2), scores, places, steps]).tolist(), strict=True)
    return [_Candidate(*one) for one in found]


def _log_misfits(
    weighted: Projected,
    window: Window,
    models: Sequence[str],
    captured: Projected,
    floor: float,
) -> Floats:
    """Log of the typical misfit with the price of the parameters, (models, blurs)."""
    count = np.array([[parameters(model)] for model in models])
    whole = np.einsum("rn,rn->r", weighted, weighted)
    left = middle(whole - captured.max(axis=1))
    misfit = np.maximum(left / np.maximum(window.size - count - 1, 1.0), 0)
    return np.asarray(np.log(misfit + floor) + _price(window) * (count - 2))


def typical_blur(profiles: Profiles, window: Window) -> float:
    """Blur that fits single rows best: where a toe is ragged, their mean is softer than they."""
    weighted = level_weighted(profiles, window)
    captured = subspaces(window, _SINGLE_ROWS, _ROW_BLURS_PX, 2.5).energies(weighted)
    logs = _log_misfits(weighted, window, _SINGLE_ROWS, captured, GREY_FLOOR)
    return _ROW_BLURS_PX[int(np.argmin(logs.min(axis=0)))]
