"""The force balance of a record, taken apart: inertia, friction by speed, ripple, slow drift.

Linear in all but the Stribeck speed and the pitch of the ripple, which are searched for. Stribeck
friction and ripple are taken in only where they explain what nothing else does.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from seamlog.analysis.axis_record import FloatArray

from .windows import Windows

STRIBECK_SPEEDS_M_S = (0.0005, 0.001, 0.002, 0.004, 0.008, 0.016)
_DRIFT_HZ = 0.1
_FEWEST_ROWS = 100
_LARGEST_CONDITION = 300.0
_SINGULAR_CONDITION = 1e4
_LEAST_GAIN = 0.03
"""Share of the remaining squares that a further effect must explain, for n rows of its own."""
_NARROW_PITCH_M = 5e-4
_LAGS = 20
_RIDGE = 1e-10
"""Keeps the search going where a tried effect looks like another one."""
_ALIKE = 100
"""Rows whose misfit resembles each other, when friction laws are compared: few reversals decide."""
_LEAST_WEIGHT = 0.05
_DRIFT = "drift"
_BASE = ("inertia", "viscous_friction", "coulomb_friction", "offset")


@dataclass(frozen=True)
class Shape:
    """What is nonlinear: Stribeck speed and power (0: Coulomb only), pitch (0: no ripple)."""

    stribeck_speed_m_s: float = 0.0
    stribeck_power: float = 1.0
    pitch_m: float = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the linear values, without those of the drift."""
        excess = ("excess",) if self.stribeck_speed_m_s else ()
        ripple = ("ripple_sine", "ripple_cosine") if self.pitch_m else ()
        return _BASE + excess + ripple


@dataclass(frozen=True)
class Explanation:
    """Values by `names` (linear ones, then Stribeck speed and pitch) with their covariance."""

    shape: Shape
    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    noise_share: float
    """Squares left over, relative to those of the force of inertia."""
    weight: float
    """Likelihood relative to the best explanation's."""

    def value(self, name: str) -> float:
        """The value called `name`, 0 if this explanation has none."""
        return float(self.values[self.names.index(name)]) if name in self.names else 0.0


def explain(windows: Windows, duration_rows: int, period_s: float) -> list[Explanation]:
    """The likely explanations, best first; none where the record is too poor for it."""
    if len(windows.rows) < _FEWEST_ROWS:
        return []
    drift = _drift(windows, duration_rows, period_s)
    plain = Shape()
    if _condition(_columns(windows, plain, drift)) > _LARGEST_CONDITION:
        return []
    shape = _with_ripple(windows, plain, drift)
    likely = _with_stribeck(windows, shape, drift)
    finished = [_finished(windows, shape, drift, weight) for shape, weight in likely]
    return [found for found in finished if found is not None]


def _drift(windows: Windows, count: int, period_s: float) -> FloatArray:
    """Cosines up to _DRIFT_HZ over the record, shape (rows, terms), without the constant."""
    terms = int(2 * _DRIFT_HZ * count * period_s)
    place = (windows.rows + 0.5) / count
    return np.cos(np.pi * np.outer(place, np.arange(1, terms + 1)))


def _columns(windows: Windows, shape: Shape, drift: FloatArray) -> FloatArray:
    direction = np.sign(windows.velocity_m_s)
    columns = [windows.acceleration_m_s2, windows.velocity_m_s, direction, np.ones(len(direction))]
    if shape.stribeck_speed_m_s:
        ratio = np.abs(windows.speeds_m_s) / shape.stribeck_speed_m_s
        columns.append(direction * windows.mean(np.exp(-(ratio**shape.stribeck_power))))
    if shape.pitch_m:
        angle = 2 * np.pi * windows.positions_m / shape.pitch_m
        columns += [windows.mean(np.sin(angle)), windows.mean(np.cos(angle))]
    return np.column_stack([*columns, drift])


def _left(windows: Windows, shape: Shape, drift: FloatArray) -> FloatArray:
    columns = _columns(windows, shape, drift)
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    square = np.einsum("ki,kj->ij", columns, columns) + _RIDGE * np.eye(columns.shape[1])
    values = np.linalg.solve(square, np.einsum("ki,k->i", columns, windows.force))
    return np.asarray(windows.force - np.einsum("ki,i->k", columns, values))


def _squares(windows: Windows, shape: Shape, drift: FloatArray) -> float:
    left = _left(windows, shape, drift)
    return float(left @ left)


def _with_ripple(windows: Windows, shape: Shape, drift: FloatArray) -> Shape:
    """`shape` with the pitch whose sine explains most, if that is enough."""
    left = _left(windows, shape, drift)
    position = windows.positions_m[:, windows.positions_m.shape[1] // 2]
    travel = float(np.ptp(position))
    waves = np.arange(3 / travel, 1 / _NARROW_PITCH_M, 0.2 / travel)
    if not len(waves):
        return shape
    power = [abs(np.exp(2j * np.pi * wave * position) @ left) for wave in waves]
    best = float(waves[int(np.argmax(power))])

    def squares(wave: float) -> float:
        return _squares(windows, replace(shape, pitch_m=1 / wave), drift)

    near = 0.2 / travel
    found = optimize.minimize_scalar(squares, bounds=(best - near, best + near), method="bounded")
    if found.fun > (1 - _LEAST_GAIN) * float(left @ left):
        return shape
    return replace(shape, pitch_m=1 / float(found.x))


def _with_stribeck(windows: Windows, shape: Shape, drift: FloatArray) -> list[tuple[Shape, float]]:
    """Coulomb friction and both Stribeck powers with their likelihoods, best first."""
    fits = [(_squares(windows, shape, drift), shape)]
    for power in (1.0, 2.0):

        def squares(log_speed: float, power: float = power) -> float:
            tried = Shape(float(np.exp(log_speed)), power, shape.pitch_m)
            return _squares(windows, tried, drift)

        speeds = np.log(STRIBECK_SPEEDS_M_S)
        best = min(speeds.tolist(), key=squares)
        found = optimize.minimize_scalar(squares, bounds=(best - 0.7, best + 0.7), method="bounded")
        tried = Shape(float(np.exp(found.x)), power, shape.pitch_m)
        fits.append((float(found.fun), tried))
    least = min(fits, key=lambda fit: fit[0])[0]
    independent = len(windows.rows) / _ALIKE
    likely = [
        (shape, float((least / left) ** (independent / 2) * np.exp(-_freedom(shape))))
        for left, shape in fits
    ]
    best = max(weight for _, weight in likely)
    likely = [(shape, weight / best) for shape, weight in likely if weight > _LEAST_WEIGHT * best]
    return sorted(likely, key=lambda fit: -fit[1])


def _freedom(shape: Shape) -> int:
    """Parameters of the friction law beside C: Akaike's price of it."""
    return 2 if shape.stribeck_speed_m_s else 0


def _finished(
    windows: Windows, shape: Shape, drift: FloatArray, weight: float
) -> Explanation | None:
    """Covariance of linear and nonlinear values together, for a coloured residual.

    None where Stribeck friction is too faint for its speed to be told.
    """
    columns = _columns(windows, shape, drift)
    linear = np.linalg.lstsq(columns, windows.force, rcond=None)[0]
    bent = _neighbours(shape)
    slopes = [
        (_columns(windows, other, drift) - columns) @ linear / step for _, step, other in bent
    ]
    names = (*shape.names, *[_DRIFT] * drift.shape[1], *(name for name, _, _ in bent))
    jacobian = np.column_stack([columns, *slopes])
    left = windows.force - columns @ linear
    if _condition(jacobian) > _SINGULAR_CONDITION:
        return None
    kept = [i for i, name in enumerate(names) if name != _DRIFT]
    values = np.concatenate([linear, [getattr(shape, name) for name, _, _ in bent]])
    whole = values + np.linalg.lstsq(jacobian, left, rcond=None)[0]
    inertia = linear[0] * windows.acceleration_m_s2
    return Explanation(
        shape=shape,
        names=tuple(names[i] for i in kept),
        values=whole[kept],
        covariance=_covariance(jacobian, left)[np.ix_(kept, kept)],
        noise_share=float(left @ left / (inertia @ inertia)),
        weight=weight,
    )


def _condition(columns: FloatArray) -> float:
    """Condition number with all columns scaled to length 1."""
    return float(np.linalg.cond(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)))


def _covariance(jacobian: FloatArray, left: FloatArray) -> FloatArray:
    """For a residual correlated over _LAGS rows (Newey and West, Econometrica 55 (1987) 703)."""
    inverse = np.linalg.inv(jacobian.T @ jacobian)
    scores = jacobian * left[:, None]
    middle = scores.T @ scores
    for lag in range(1, _LAGS + 1):
        lagged = scores[lag:].T @ scores[:-lag]
        middle += (1 - lag / (_LAGS + 1)) * (lagged + lagged.T)
    return np.asarray(inverse @ middle @ inverse)


def _neighbours(shape: Shape) -> list[tuple[str, float, Shape]]:
    """Name, step and stepped shape of each nonlinear value, for slopes by difference."""
    found: list[tuple[str, float, Shape]] = []
    speed, pitch = shape.stribeck_speed_m_s, shape.pitch_m
    if speed:
        step = 1e-3 * speed
        found.append(("stribeck_speed_m_s", step, replace(shape, stribeck_speed_m_s=speed + step)))
    if pitch:
        step = 1e-5 * pitch
        found.append(("pitch_m", step, replace(shape, pitch_m=pitch + step)))
    return found
