"""Linear-quadratic gains of a single-input system, from `+ - * /` alone: the same everywhere."""

import math

from seamlog.errors import UsageError

Matrix = list[list[float]]
_DOUBLINGS = 60


def regulator_gains(a: Matrix, b: list[float], state_weights: list[float], r: float) -> list[float]:
    """Gains k of u = -k z that minimise the sum of z' diag(state_weights) z + r u^2.

    For z+ = a z + b u, by the structured doubling of the Riccati equation, which looks 2^n
    periods ahead after n rounds; `UsageError` if it does not settle.
    """
    size = range(len(b))
    step: Matrix = [list(row) for row in a]
    reach = [[x * y / r for y in b] for x in b]
    cost = [[state_weights[i] if i == j else 0.0 for j in size] for i in size]
    for _ in range(_DOUBLINGS):
        both = _times(reach, cost)
        mixed = [[both[i][j] + (1.0 if i == j else 0.0) for j in size] for i in size]
        onward = _solve(mixed, step)
        growth = _times(_transposed(step), _times(cost, onward))
        spread = _times(_times(step, _solve(mixed, reach)), _transposed(step))
        cost, reach, step = _sum(cost, growth), _sum(reach, spread), _times(step, onward)
        largest = _largest(cost)
        if not math.isfinite(largest):
            break
        if _largest(growth) <= 1e-14 * largest:
            return _gains(a, b, cost, r)
    raise UsageError(
        "the linear-quadratic design does not settle on this axis: bring its weights closer "
        "together"
    )


def _gains(a: Matrix, b: list[float], cost: Matrix, r: float) -> list[float]:
    weighed = _times([b], cost)[0]
    scale = r + sum(x * y for x, y in zip(weighed, b, strict=True))
    return [value / scale for value in _times([weighed], a)[0]]


def _solve(a: Matrix, right: Matrix) -> Matrix:
    """Inverse of `a` times `right`, by elimination with partial pivoting."""
    rows = [[*left, *values] for left, values in zip(a, right, strict=True)]
    size = len(a)
    for k in range(size):
        pivot = max(range(k, size), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for i in range(size):
            if i != k and rows[i][k] != 0.0:
                factor = rows[i][k]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    return [row[size:] for row in rows]


def _times(a: Matrix, b: Matrix) -> Matrix:
    columns = _transposed(b)
    return [[sum(x * y for x, y in zip(row, c, strict=True)) for c in columns] for row in a]


def _transposed(a: Matrix) -> Matrix:
    return [list(column) for column in zip(*a, strict=True)]


def _sum(a: Matrix, b: Matrix) -> Matrix:
    return [[x + y for x, y in zip(p, q, strict=True)] for p, q in zip(a, b, strict=True)]


def _largest(a: Matrix) -> float:
    return max(abs(value) for row in a for value in row)
