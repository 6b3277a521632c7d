"""Linear-quadratic gains of a single-input system, from `+ - * /` alone: the same everywhere."""

from seamlog.errors import UsageError

Matrix = list[list[float]]
_ROUNDS = 20_000


def regulator_gains(a: Matrix, b: list[float], state_weights: list[float], r: float) -> list[float]:
    """Gains k of u = -k z that minimise the sum of z' diag(state_weights) z + r u^2.

    By iterating the Riccati equation of z+ = a z + b u; `UsageError` if it does not settle.
    """
    size = range(len(b))
    p = [[state_weights[i] if i == j else 0.0 for j in size] for i in size]
    last = [0.0 for _ in size]
    for _ in range(_ROUNDS):
        pa = [[sum(p[i][m] * a[m][j] for m in size) for j in size] for i in size]
        pb = [sum(p[i][m] * b[m] for m in size) for i in size]
        scale = r + sum(b[i] * pb[i] for i in size)
        bpa = [sum(b[m] * pa[m][j] for m in size) for j in size]
        gains = [value / scale for value in bpa]
        p = [
            [
                sum(a[m][i] * pa[m][j] for m in size)
                - bpa[i] * gains[j]
                + (state_weights[i] if i == j else 0.0)
                for j in size
            ]
            for i in size
        ]
        change = max(abs(new - old) for new, old in zip(gains, last, strict=True))
        if change <= 1e-12 * max(abs(value) for value in gains) and any(gains):
            return gains
        last = gains
    raise UsageError(
        "the linear-quadratic design does not settle on this axis: bring its weights "
        "closer together"
    )
