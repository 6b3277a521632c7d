"""Linear least squares with what is needed to doubt it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

from .friction_models import FloatArray

SINGULAR_CONDITION = 1e4
"""Condition number of the scaled regressor from which parameters cannot be told apart."""


@dataclass(frozen=True)
class Fit:
    """Parameters of `regressor @ values = measured`.

    `covariance`, shape (p, p), allows for residuals that resemble each other; `white_covariance`
    is the textbook one, which most publications print. A nonlinear fit brings its own `predicted`
    and its Jacobian for `regressor`.
    """

    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    white_covariance: FloatArray
    regressor: FloatArray
    measured: FloatArray
    predicted: FloatArray

    @cached_property
    def residual(self) -> FloatArray:
        """Measured - predicted, shape (rows,), in the unit of `measured`."""
        return np.asarray(self.measured - self.predicted)

    @property
    def sd(self) -> FloatArray:
        """Standard deviation of each parameter."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def white_sd(self) -> FloatArray:
        """Standard deviation if the residual were white."""
        return np.sqrt(np.diag(self.white_covariance))

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


def least_squares(
    names: tuple[str, ...],
    regressor: FloatArray,
    measured: FloatArray,
    block: NDArray[np.int64],
    instruments: FloatArray | None = None,
) -> Fit:
    """Least squares, or instrumental variables with `instruments` of the regressor's shape.

    Raises `EvidenceError` for columns that cannot be told apart.
    """
    require_apart(names, regressor)
    left = regressor if instruments is None else instruments
    inverse = np.asarray(np.linalg.inv(left.T @ regressor), dtype=np.float64)
    if instruments is None:
        values = np.asarray(np.linalg.lstsq(regressor, measured, rcond=None)[0], dtype=np.float64)
    else:
        values = inverse @ (left.T @ measured)
    residual = measured - regressor @ values
    white = inverse @ (left.T @ left) @ inverse.T * float(np.var(residual, ddof=1))
    clustered = clustered_covariance(inverse, left, residual, block)
    return Fit(
        names,
        values,
        not_below(clustered, white),
        white,
        regressor,
        measured,
        regressor @ values,
    )


def clustered_covariance(
    inverse: FloatArray, left: FloatArray, residual: FloatArray, block: NDArray[np.int64]
) -> FloatArray:
    """Sandwich estimate: rows of one block may err alike, blocks err on their own.

    Liang and Zeger (Biometrika 73 (1986) 13-22), with the usual factor for few blocks.
    """
    _, label = np.unique(block, return_inverse=True)
    count, parameters = int(label.max()) + 1, left.shape[1]
    scores = np.zeros((count, parameters))
    np.add.at(scores, label, left * residual[:, None])
    few = count / max(1, count - parameters)
    return np.asarray(few * inverse @ (scores.T @ scores) @ inverse.T, dtype=np.float64)


def not_below(covariance: FloatArray, least: FloatArray) -> FloatArray:
    """`covariance`, widened where a deviation is below that of `least` (chance of few blocks)."""
    own, floor = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(least))
    widen = np.where(own > 0, np.maximum(1.0, floor / np.where(own > 0, own, 1.0)), 1.0)
    return np.asarray(covariance * np.outer(widen, widen), dtype=np.float64)


def require_apart(names: tuple[str, ...], regressor: FloatArray) -> None:
    """`EvidenceError` naming the parameters that the rows cannot tell apart."""
    _, strength, directions = np.linalg.svd(scaled(regressor), full_matrices=False)
    if strength[-1] * SINGULAR_CONDITION < strength[0]:
        weakest = zip(names, directions[-1], strict=True)
        mixed = [name for name, share in weakest if abs(share) > 0.1]
        raise EvidenceError(
            f"this motion cannot tell {' and '.join(mixed)} apart (condition number "
            f"above {SINGULAR_CONDITION:g}); record a run whose speed and acceleration both vary"
        )
