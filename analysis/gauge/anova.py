"""Gauge repeatability and reproducibility by analysis of variance (AIAG MSA, 4th edition).

Crossed study: every operator measures every part several times. Where the interaction of part and
operator is not significant (p > 0.25) it is pooled with the repeatability.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from seamlog.errors import EvidenceError

Floats = NDArray[np.float64]

_POOLED_FROM = 0.25
CONFIDENCE = 0.9


@dataclass(frozen=True, slots=True)
class GaugeRR:
    """Standard deviations of the parts of variation, in the unit of the values.

    `repeatability` (EV), `operators` and `interaction` (together reproducibility, AV), `parts`
    (PV). `repeatability_low` and `_high` bound EV with 90 % confidence. `interaction_p` is None
    where there is no interaction to test.
    """

    repeatability: float
    operators: float
    interaction: float
    parts: float
    repeatability_low: float
    repeatability_high: float
    interaction_p: float | None
    pooled: bool
    shape: tuple[int, int, int]

    @property
    def reproducibility(self) -> float:
        """AV: operators and their interaction with parts."""
        return float(np.hypot(self.operators, self.interaction))

    @property
    def gauge(self) -> float:
        """GRR: repeatability and reproducibility."""
        return float(np.hypot(self.repeatability, self.reproducibility))

    @property
    def total(self) -> float:
        """TV: gauge and parts."""
        return float(np.hypot(self.gauge, self.parts))

    @property
    def percent_grr(self) -> float:
        """GRR in percent of the total variation; below 10 good, above 30 unusable."""
        return 100 * self.gauge / self.total if self.total > 0 else float("nan")

    @property
    def categories(self) -> int:
        """ndc: how many classes of parts can be told apart; 5 or more are wanted."""
        if self.gauge <= 0:
            return 0 if self.parts <= 0 else 10**6
        return int(np.sqrt(2) * self.parts / self.gauge)

    def percent_tolerance(self, tolerance: float) -> float:
        """6 GRR in percent of a tolerance (upper - lower limit)."""
        return 100 * 6 * self.gauge / tolerance


def gauge_rr(values: Floats) -> GaugeRR:
    """Variation from values of shape (parts, operators, trials), two parts and two trials or more.

    One operator gives repeatability only. Raises `EvidenceError` for smaller or incomplete studies.
    """
    if values.ndim != 3 or values.shape[0] < 2 or values.shape[2] < 2 or values.shape[1] < 1:
        raise EvidenceError(
            f"a study of {' x '.join(map(str, values.shape))} (parts x operators x trials) tells "
            "nothing; at least 2 parts and 2 trials are needed, better 10 parts and 3 trials"
        )
    if not np.isfinite(values).all():
        raise EvidenceError("the study is not complete: every part needs a value in every trial")
    p, o, n = values.shape
    grand = values.mean()
    by_part, by_operator, cells = values.mean((1, 2)), values.mean((0, 2)), values.mean(2)
    square_part = o * n * np.sum((by_part - grand) ** 2)
    square_operator = p * n * np.sum((by_operator - grand) ** 2)
    square_cell = n * np.sum((cells - grand) ** 2)
    square_both = max(float(square_cell - square_part - square_operator), 0.0)
    square_error = float(np.sum((values - cells[:, :, None]) ** 2))
    free_both, free_error = (p - 1) * (o - 1), p * o * (n - 1)
    error = square_error / free_error
    probability = _probability(square_both, free_both, error, free_error)
    pooled = probability is None or probability > _POOLED_FROM
    if pooled:
        free_error += free_both
        error = (square_error + square_both) / free_error
    beside = error if pooled else square_both / free_both
    part = max((square_part / (p - 1) - beside) / (o * n), 0.0)
    operator = max((square_operator / (o - 1) - beside) / (p * n), 0.0) if o > 1 else 0.0
    both = 0.0 if pooled else max((beside - error) / n, 0.0)
    low, high = _interval(error, free_error)
    return GaugeRR(
        repeatability=float(np.sqrt(error)),
        operators=float(np.sqrt(operator)),
        interaction=float(np.sqrt(both)),
        parts=float(np.sqrt(part)),
        repeatability_low=low,
        repeatability_high=high,
        interaction_p=probability,
        pooled=pooled,
        shape=(p, o, n),
    )


def _probability(square: float, free: int, error: float, free_error: int) -> float | None:
    """Of an interaction at least this large by chance (F test); None without interaction."""
    if free == 0 or error <= 0:
        return None
    return float(special.fdtrc(free, free_error, square / free / error))


def _interval(variance: float, free: int) -> tuple[float, float]:
    tail = (1 - CONFIDENCE) / 2
    bounds = (free * variance / special.chdtri(free, 1 - part) for part in (1 - tail, tail))
    low, high = (float(np.sqrt(bound)) for bound in bounds)
    return low, high
