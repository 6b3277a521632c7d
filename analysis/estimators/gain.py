"""A symmetric 3 x 3 gain matrix and its update, in plain arithmetic.

Rows and columns: inertia, viscous friction, Coulomb friction.
"""

Vector = tuple[float, float, float]
Gain = tuple[float, float, float, float, float, float]
"""Upper triangle by rows: 11, 12, 13, 22, 23, 33."""


def diagonal_gain(diagonal: Vector) -> Gain:
    """The matrix with this diagonal."""
    return diagonal[0], 0.0, 0.0, diagonal[1], 0.0, diagonal[2]


def times(gain: Gain, w: Vector) -> Vector:
    """Gain times column `w`."""
    g11, g12, g13, g22, g23, g33 = gain
    return (
        g11 * w[0] + g12 * w[1] + g13 * w[2],
        g12 * w[0] + g22 * w[1] + g23 * w[2],
        g13 * w[0] + g23 * w[1] + g33 * w[2],
    )


def reduced(gain: Gain, step: Vector, weight: float, factor: float) -> Gain:
    """The matrix factor x (gain - weight x step step^T)."""
    a, b, c = step
    g11, g12, g13, g22, g23, g33 = gain
    return (
        factor * (g11 - weight * a * a),
        factor * (g12 - weight * a * b),
        factor * (g13 - weight * a * c),
        factor * (g22 - weight * b * b),
        factor * (g23 - weight * b * c),
        factor * (g33 - weight * c * c),
    )


def largest_eigenvalue(gain: Gain) -> float:
    """2-norm of a positive semidefinite gain, by Newton's method from its trace.

    The characteristic cubic has three real roots and is convex above the largest, so the steps
    fall onto it from above and cannot pass it.
    """
    g11, g12, g13, g22, g23, g33 = gain
    trace = g11 + g22 + g33
    minors = g11 * g22 - g12 * g12 + g11 * g33 - g13 * g13 + g22 * g33 - g23 * g23
    determinant = (
        g11 * (g22 * g33 - g23 * g23)
        - g12 * (g12 * g33 - g23 * g13)
        + g13 * (g12 * g23 - g22 * g13)
    )
    root = trace
    for _ in range(60):
        slope = (3.0 * root - 2.0 * trace) * root + minors
        if slope <= 0.0:
            break
        step = (((root - trace) * root + minors) * root - determinant) / slope
        root -= step
        if step <= 1e-12 * root:
            break
    return root
