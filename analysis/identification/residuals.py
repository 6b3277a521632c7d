"""What the residual of a fit still tells: whether it is noise, or follows place or speed."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from .friction_models import FloatArray
from .method import Identification

LAGS = 20
_BINS = 20
_LEAST_PER_BIN = 8
_SURE = 1e-3


@dataclass(frozen=True)
class Dependence:
    """Residual in bins of position or speed; `share` of its variance they explain beyond chance.

    `significance` is the probability of as much by chance, allowing for correlated rows.
    """

    centre: FloatArray
    mean: FloatArray
    sd: FloatArray
    share: float
    significance: float

    @property
    def is_sure(self) -> bool:
        """Whether chance is excluded."""
        return self.significance < _SURE


@dataclass(frozen=True)
class ResidualAnalysis:
    """Autocorrelation at lags 1 to LAGS rows, Ljung and Box's test of whiteness, dependences."""

    autocorrelation: FloatArray
    whiteness_significance: float
    effective_rows: float
    by_position: Dependence
    by_speed: Dependence

    @property
    def is_white(self) -> bool:
        """Whether the residual may be white noise (1 % level)."""
        return self.whiteness_significance > 0.01


def analyse_residual(found: Identification) -> ResidualAnalysis:
    """Ljung and Box (Biometrika 65 (1978) 297-303) and two one-way analyses of variance.

    A fit to positions is judged by the forces it predicts on the rows of the record.
    """
    residual = found.fit.residual
    if len(residual) != len(found.rows.position_m):
        residual = found.rows.measured - found.rows.regressor @ found.fit.values
    centred = residual - residual.mean()
    count, squares = len(centred), float(centred @ centred)
    lags = min(LAGS, count // 4)
    alike = np.array([centred[lag:] @ centred[:-lag] / squares for lag in range(1, lags + 1)])
    statistic = count * (count + 2) * float(np.sum(alike**2 / (count - np.arange(1, lags + 1))))
    effective = count / max(
        1.0, 1 + 2 * float(np.sum(alike * (1 - np.arange(1, lags + 1) / count)))
    )
    return ResidualAnalysis(
        autocorrelation=alike,
        whiteness_significance=float(special.chdtrc(lags, statistic)),
        effective_rows=effective,
        by_position=_dependence(found.rows.position_m, centred, effective),
        by_speed=_dependence(found.rows.velocity_m_s, centred, effective),
    )


def _dependence(along: FloatArray, residual: FloatArray, effective: float) -> Dependence:
    edges = np.linspace(float(along.min()), float(along.max()), _BINS + 1)
    bins = np.clip(np.searchsorted(edges, along, side="right") - 1, 0, _BINS - 1)
    counts = np.bincount(bins, minlength=_BINS)
    used = counts >= _LEAST_PER_BIN
    sums = np.bincount(bins, residual, _BINS)[used]
    squares = np.bincount(bins, residual**2, _BINS)[used]
    counts = counts[used]
    mean = sums / counts
    between, total = float(counts @ mean**2), float(residual @ residual)
    groups, rows = len(counts), len(residual)
    if groups < 2 or total <= between:
        return Dependence(np.zeros(0), np.zeros(0), np.zeros(0), 0.0, 1.0)
    shrink = effective / rows
    free = max(1.0, effective - groups)
    ratio = (between * shrink / (groups - 1)) / ((total - between) * shrink / free)
    chance = total * (groups - 1) / max(1.0, effective - 1)
    return Dependence(
        centre=(0.5 * (edges[1:] + edges[:-1]))[used],
        mean=mean,
        sd=np.sqrt(np.maximum(squares / counts - mean**2, 0.0)),
        share=max(0.0, (between - chance) / total),
        significance=float(special.fdtrc(groups - 1, free, ratio)),
    )
