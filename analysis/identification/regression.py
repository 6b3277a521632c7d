"""Linear least squares with what is needed to doubt it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seamlog.errors import EvidenceError

from .filtering import FloatArray

SINGULAR_CONDITION = 1e4
"""Condition number of the scaled regressor from which parameters cannot be told apart."""


@dataclass(frozen=True)
class Fit:
    """Parameters of `regressor @ values = measured`.

    `covariance` has shape (p, p). `residual` is measured - predicted, in the unit of `measured`,
    on the rows that entered the regression.
    """

    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    regressor: FloatArray
    measured: FloatArray

    @cached_property
    def residual(self) -> FloatArray:
        """Measured - predicted, shape (rows,)."""
        return np.asarray(self.measured - self.regressor @ self.values)

    @property
    def sd(self) -> FloatArray:
        """Standard deviation of each parameter."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def condition_number(self) -> float:
        """Condition number of the regressor as it stands, units and all."""
        return float(np.linalg.cond(self.regressor))

    @cached_property
    def scaled_condition_number(self) -> float:
        """Condition number with all columns scaled to length 1: free of units."""
        return float(np.linalg.cond(scaled(self.regressor)))

    @property
    def residual_norm(self) -> float:
        """Euclidean norm of the residual."""
        return float(np.linalg.norm(self.residual))

    @property
    def relative_error(self) -> float:
        """Norm of the residual over norm of the measured force."""
        return self.residual_norm / float(np.linalg.norm(self.measured))

    def value(self, name: str) -> float:
        """The parameter called `name`."""
        return float(self.values[self.names.index(name)])

    def deviation(self, name: str) -> float:
        """Standard deviation of the parameter called `name`."""
        return float(self.sd[self.names.index(name)])


def scaled(regressor: FloatArray) -> FloatArray:
    """Columns scaled to length 1; columns of zeros stay zeros."""
    length = np.linalg.norm(regressor, axis=0)
    return np.asarray(regressor / np.where(length > 0, length, 1.0))


def least_squares(names: tuple[str, ...], regressor: FloatArray, measured: FloatArray) -> Fit:
    """Ordinary least squares; the covariance takes the residual as white."""
    values, inverse = _solve(names, regressor, measured)
    residual = measured - regressor @ values
    covariance = inverse * float(np.var(residual, ddof=1))
    return Fit(names, values, covariance, regressor, measured)


def correlated_least_squares(
    names: tuple[str, ...], regressor: FloatArray, measured: FloatArray, lags: int
) -> Fit:
    """Least squares whose covariance allows for a residual correlated over `lags` rows.

    Newey and West's estimate with Bartlett weights (Econometrica 55 (1987) 703-708).
    """
    values, inverse = _solve(names, regressor, measured)
    scores = regressor * (measured - regressor @ values)[:, None]
    middle = scores.T @ scores
    for lag in range(1, min(lags, len(scores) - 1) + 1):
        lagged = scores[lag:].T @ scores[:-lag]
        middle += (1 - lag / (lags + 1)) * (lagged + lagged.T)
    return Fit(names, values, inverse @ middle @ inverse, regressor, measured)


def _solve(
    names: tuple[str, ...], regressor: FloatArray, measured: FloatArray
) -> tuple[FloatArray, FloatArray]:
    _, strength, directions = np.linalg.svd(scaled(regressor), full_matrices=False)
    if strength[-1] * SINGULAR_CONDITION < strength[0]:
        weakest = zip(names, directions[-1], strict=True)
        mixed = [name for name, share in weakest if abs(share) > 0.1]
        raise EvidenceError(
            f"this motion cannot tell {' and '.join(mixed)} apart (condition number "
            f"above {SINGULAR_CONDITION:g}); record a run whose speed and acceleration both vary"
        )
    values = np.asarray(np.linalg.lstsq(regressor, measured, rcond=None)[0], dtype=np.float64)
    inverse = np.asarray(np.linalg.inv(regressor.T @ regressor), dtype=np.float64)
    return values, inverse
