"""Which friction model and lag the record itself bears out: cross-validation over its stretches.

The record is cut into ten consecutive parts; each is predicted by a fit to the other nine. Of the
candidates whose error is within one standard error, or 2 %, of the best the simplest is taken.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from seamlog.errors import EvidenceError

from .friction_models import FRICTIONS, FloatArray, Friction
from .method import Rows
from .regression import require_apart

FOLDS = 10
_MATTERS = 1.02
"""Ratio of errors below which a better prediction is not worth another parameter."""


@dataclass(frozen=True)
class Candidate:
    """Relative force errors in percent: on parts left out and on what was fitted."""

    friction: Friction
    lag_periods: float
    parameters: int
    left_out_error: float
    fitted_error: float
    fold_squares: FloatArray


@dataclass(frozen=True)
class Selection:
    """All candidates, best first, the chosen one and why."""

    candidates: tuple[Candidate, ...]
    chosen: Candidate
    reason: str


def select_model(
    rows_of: Callable[[Friction, float], Rows], lags_periods: Iterable[float]
) -> Selection:
    """Judge every friction model at every lag; `EvidenceError` if none can be judged."""
    tried = [
        _candidate(rows_of(friction, lag), friction, lag)
        for lag in lags_periods
        for friction in FRICTIONS
    ]
    candidates = sorted((one for one in tried if one), key=lambda one: one.left_out_error)
    if not candidates:
        raise EvidenceError("no friction model can be told from parts of this record")
    best = candidates[0]
    near = [one for one in candidates if _is_as_good(one, best)]
    simplest = min(one.parameters for one in near)
    chosen = min(
        (one for one in near if one.parameters == simplest), key=lambda one: one.left_out_error
    )
    return Selection(tuple(candidates), chosen, _reason(chosen, best, candidates))


def _candidate(rows: Rows, friction: Friction, lag: float) -> Candidate | None:
    X, y = rows.regressor, rows.measured
    try:
        require_apart(rows.names, X)
    except EvidenceError:
        return None
    fold = np.arange(len(y)) * FOLDS // len(y)
    squares = []
    for part in range(FOLDS):
        out = fold == part
        values = np.linalg.lstsq(X[~out], y[~out], rcond=None)[0]
        squares.append(float(np.sum((y[out] - X[out] @ values) ** 2)))
    values = np.linalg.lstsq(X, y, rcond=None)[0]
    norm = float(np.linalg.norm(y))
    return Candidate(
        friction,
        lag,
        X.shape[1] + (1 if lag else 0),
        100 * float(np.sqrt(sum(squares))) / norm,
        100 * float(np.linalg.norm(y - X @ values)) / norm,
        np.array(squares) / norm**2,
    )


def _is_as_good(one: Candidate, best: Candidate) -> bool:
    """Whether the squares of `one` exceed those of `best` by no more than chance over the folds."""
    if one.left_out_error <= _MATTERS * best.left_out_error:
        return True
    more = one.fold_squares - best.fold_squares
    return float(more.sum()) <= float(np.std(more, ddof=1) * np.sqrt(FOLDS))


def _reason(chosen: Candidate, best: Candidate, candidates: list[Candidate]) -> str:
    plain = next((one for one in candidates if one.friction == "symmetric"), None)
    told = f"{_named(chosen)} predicts parts left out to {chosen.left_out_error:.2f} %"
    if plain is not None and plain is not chosen:
        told += f", symmetric friction to {plain.left_out_error:.2f} %"
    if chosen is not best:
        told += f"; {_named(best)} ({best.left_out_error:.2f} %) is better by chance or 2 % at most"
    return told


def _named(one: Candidate) -> str:
    lag = f" with {one.lag_periods:g} periods of lag" if one.lag_periods else ""
    return one.friction.replace("-stribeck", " + Stribeck") + " friction" + lag
