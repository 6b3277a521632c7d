"""Which model a toe needs: chosen on mean profiles over stretches of it.

Shading and lines beside a toe vary slowly along it, so they are fitted on means. Taken off, they
leave a plain step to each row, which is the least noisy thing to place.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from .edge_shapes import (
    COARSE,
    MODELS,
    Floats,
    Projected,
    Window,
    basis,
    energy,
    fit,
    level_weighted,
    parameters,
    peak,
    resolved,
    shifts_within,
    subspaces,
)

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
_BLOCKS = 16
_TRUST = 0.25
"""Part of what a richer model moves an edge by that stays in doubt."""
_CALM = 5.0
"""Rows over which single rows' places are averaged to align profiles."""


@dataclass(frozen=True, slots=True)
class EdgeModel:
    """What was chosen for a toe: model, blur, the doubt between models, and what is not step.

    `shading` (blocks, window) are ramps and lines beside the step at equal stretches of the toe,
    in profiles that are aligned as `alignment` does.
    """

    window: Window
    name: str
    blur: float
    u: float
    shading: Floats


def profiles_at(signal: NDArray[np.float32], centre: NDArray[np.int64], window: Window) -> Floats:
    """Profiles (rows, window) around a column per row of a signal with the bead to the right."""
    columns = centre[:, None] + window.columns.astype(np.int64)
    rows = np.arange(len(signal))[:, None]
    return np.asarray(signal[rows, np.clip(columns, 0, signal.shape[1] - 1)], dtype=np.float64)


def choose_model(
    signal: NDArray[np.float32], centre: NDArray[np.int64], window: Window
) -> EdgeModel:
    """The model for a toe: on mean profiles of blocks of rows, aligned by a first plain fit.

    Where there is shading or a line beside the step, a narrower window keeps what is farther
    away out of it.
    """
    means = _means(signal, centre, window)
    model, doubt = _chosen(means, window)
    near = window.around(model.blur)
    if model.name != "step" and near != window:
        window, means = near, _means(signal, centre, near)
        model, doubt = _chosen(means, window)
    return EdgeModel(window, model.name, model.blur, doubt, _shading(means, window, model))


def _means(signal: NDArray[np.float32], centre: NDArray[np.int64], window: Window) -> Floats:
    profiles = profiles_at(signal, centre, window)
    return aligned_means(profiles, alignment(profiles, centre, window))


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A model at its best blur: log misfit with the price of its parameters, and its place."""

    name: str
    blur: float
    score: float
    place: float


@dataclass(frozen=True, slots=True)
class _Weighed:
    """Mean profiles, weighted, the energy of each, and the least misfit that any may have."""

    profiles: Projected
    whole: Projected
    floor: float

    @classmethod
    def of(cls, means: Floats, window: Window) -> "_Weighed":
        weighted = level_weighted(means, window)
        floor = GREY_FLOOR + (EDGE_FLOOR * float(np.median(np.ptp(means, axis=1)))) ** 2
        return cls(weighted, np.einsum("rn,rn->r", weighted, weighted), floor)


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
    seen = _Weighed.of(means, window)
    plain = _candidate(seen, window, "step")
    least = _CARRIES * _step(means, window, plain)
    names = [name for name in MODELS if name != plain.name and resolved(name, plain.blur)]
    richer = sorted((_candidate(seen, window, name) for name in names), key=_by_score)
    kept = [plain]
    for one in richer:
        if one.score > min(kept, key=_by_score).score + _FAR * _price(window):
            break
        if _step(means, window, one) > least:
            kept.append(one)
    return kept


def _by_score(candidate: _Candidate) -> float:
    return candidate.score


def _step(means: Floats, window: Window, candidate: _Candidate) -> float:
    """Height of a model's step in the mean of all profiles."""
    parts = basis(window.columns - candidate.place, candidate.name, candidate.blur)
    weight = window.weight
    found = np.linalg.lstsq(parts * weight[:, None], means.mean(axis=0) * weight, rcond=None)
    return float(found[0][1])


def _price(window: Window) -> float:
    """How much lower (log) the misfit must be for each further parameter (Schwarz 1978)."""
    return float(np.log(window.size)) / window.size


def alignment(profiles: Floats, centre: NDArray[np.int64], window: Window) -> Floats:
    """Shift of each row's edge by a plain fit, calmed along the toe."""
    first = fit(profiles, window, "step", 1.5, 2.5).shift
    return np.asarray(gaussian_filter1d(first + centre, _CALM, mode="nearest") - centre)


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


def aligned_means(profiles: Floats, shift: Floats) -> Floats:
    """Means of blocks of rows, each row moved by its shift."""
    blocks = np.array_split(np.arange(len(profiles)), min(_BLOCKS, max(1, len(profiles) // 4)))
    straight = moved(profiles, np.arange(len(profiles)), shift)
    return np.array([straight[block].mean(axis=0) for block in blocks])


def moved(profiles: Floats, rows: NDArray[np.int64], shift: Floats) -> Floats:
    """Profiles of some rows read `shift` columns further on (linear interpolation)."""
    last = profiles.shape[1] - 1
    columns = np.clip(np.arange(last + 1) + shift[:, None], 0, last)
    left = np.minimum(columns.astype(np.int64), last - 1)
    part = columns - left
    at = rows[:, None]
    return np.asarray((1 - part) * profiles[at, left] + part * profiles[at, left + 1])


def _candidate(means: _Weighed, window: Window, model: str) -> _Candidate:
    """A model at the blur, between those that are tried, where its misfit is least."""
    shifts = shifts_within(1.5, COARSE)
    bases = subspaces(window, model, _BLURS_PX, 1.5, COARSE)
    captured = energy((means.profiles @ bases).reshape(len(means.whole), parameters(model), -1))
    captured = captured.reshape(len(means.whole), len(_BLURS_PX), len(shifts))
    freedom = max(window.size - parameters(model) - 1, 1.0)
    misfit = np.median(means.whole[:, None] - captured.max(axis=2), axis=0) / freedom
    logs = np.log(np.maximum(misfit, 0) + means.floor)
    at = int(np.clip(np.argmin(logs), 1, len(logs) - 2))
    a, b, c = logs[at - 1 : at + 2]
    move = float(np.clip(0.5 * (a - c) / max(a - 2 * b + c, 1e-9), -1, 1))
    blur = round(float(_BLURS_PX[at] * (_BLURS_PX[1] / _BLURS_PX[0]) ** move), 2)
    price = _price(window) * (parameters(model) - 2)
    places, _, _ = peak(captured[:, int(np.argmin(logs))], shifts)
    score = float(b - 0.25 * (a - c) * move) + price
    return _Candidate(model, blur, score, float(np.median(places)))


def typical_blur(profiles: Floats, window: Window) -> float:
    """Blur that fits single rows best: where a toe is ragged, their mean is softer than they."""
    weighted = level_weighted(profiles, window)
    whole = (weighted**2).sum(axis=1, keepdims=True)
    scores = []
    for model in _SINGLE_ROWS:
        bases = subspaces(window, model, _ROW_BLURS_PX, 2.5, COARSE)
        captured = energy((weighted @ bases).reshape(len(profiles), parameters(model), -1))
        most = captured.reshape(len(profiles), len(_ROW_BLURS_PX), -1).max(axis=2)
        freedom = max(window.size - parameters(model) - 1, 1.0)
        misfit = np.median(whole - most, axis=0) / freedom
        price = _price(window) * (parameters(model) - 2)
        logs = np.log(np.maximum(misfit, 0) + GREY_FLOOR) + price
        scores += list(zip(logs.tolist(), _ROW_BLURS_PX, strict=True))
    return min(scores)[1]
