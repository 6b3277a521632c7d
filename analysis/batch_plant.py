"""Many axes stepped together, each exactly from event to event; see `CoulombPlant` for one.

numpy's exp and log differ from the scalar ones in the last bits, so a batch follows the scalar
path to rounding, not to the bit.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seamlog.contracts import Axis

from .dynamics import backward_axis, held_motion

Floats = NDArray[np.float64]
_SERIES_BELOW = 0.02


class CoulombPlants:
    """Axes with Coulomb and viscous friction; all arrays have the shape (axes,)."""

    def __init__(self, axes: Sequence[Axis], period_s: float) -> None:
        self._period_s = period_s
        self._inertia = np.array([axis.inertia for axis in axes])
        self._offset = np.array([axis.offset for axis in axes])
        self._forward = _Side(axes, period_s)
        self._backward = _Side([backward_axis(axis) for axis in axes], period_s)
        self._same = self._forward.equals(self._backward)

    def step(
        self, position_m: Floats, velocity_m_s: Floats, command: Floats, disturbance: Floats | float
    ) -> tuple[Floats, Floats]:
        """Positions and velocities one period later."""
        force = command - self._offset - disturbance
        sense = np.sign(velocity_m_s)
        resting = sense == 0.0
        if resting.any():
            held = (force <= self._forward.static) & (force >= -self._backward.static)
            sense = np.where(resting, np.where(held, 0.0, np.sign(force)), sense)
        side = self._side(sense)
        net = (force - sense * side.coulomb) * np.abs(sense)
        end_m_s = side.decay * velocity_m_s + side.speed_gain * net
        end_m = position_m + side.travel * velocity_m_s + side.travel_gain * net
        turned = np.flatnonzero((np.sign(end_m_s) == -sense) & (sense != 0.0))
        if len(turned):
            end_m[turned], end_m_s[turned] = self._through_rest(
                turned, position_m[turned], velocity_m_s[turned], force[turned]
            )
        return end_m, end_m_s

    def _side(self, sense: Floats) -> "_Side":
        if self._same:
            return self._forward
        return self._forward.where(sense > 0.0, self._backward)

    def _through_rest(
        self, rows: NDArray[np.intp], position_m: Floats, velocity_m_s: Floats, force: Floats
    ) -> tuple[Floats, Floats]:
        forward, backward = self._forward.at(rows), self._backward.at(rows)
        inertia, sense = self._inertia[rows], np.sign(velocity_m_s)
        side = forward.where(sense > 0.0, backward)
        pull = force - sense * side.coulomb - side.viscous * velocity_m_s
        share = side.viscous * velocity_m_s / pull
        slope = np.where(share == 0.0, 1.0, np.log1p(share) / np.where(share == 0.0, 1.0, share))
        stop_s = np.clip(-velocity_m_s * inertia / pull * slope, 0.0, self._period_s)
        position_m, _ = _glide(position_m, velocity_m_s, pull / inertia, stop_s, side, inertia)
        held = (force <= forward.static) & (force >= -backward.static)
        side = forward.where(force > 0.0, backward)
        start_m_s2 = np.where(held, 0.0, (force - np.sign(force) * side.coulomb) / inertia)
        rest_s = self._period_s - stop_s
        return _glide(position_m, np.zeros_like(stop_s), start_m_s2, rest_s, side, inertia)


class _Side:
    """Constants of motion in one direction."""

    _NAMES = ("viscous", "coulomb", "static", "decay", "travel", "speed_gain", "travel_gain")

    def __init__(self, axes: Sequence[Axis], period_s: float) -> None:
        self.viscous = np.array([axis.viscous_friction for axis in axes])
        self.coulomb = np.array([axis.coulomb_friction for axis in axes])
        self.static = np.maximum([axis.static_friction for axis in axes], self.coulomb)
        held = np.array([held_motion(axis, period_s) for axis in axes]).T
        self.decay, self.travel, self.speed_gain, self.travel_gain = held

    def equals(self, other: "_Side") -> bool:
        """Whether friction is the same in both directions, on all axes."""
        return all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in self._NAMES
        )

    def at(self, rows: NDArray[np.intp]) -> "_Side":
        """Those of some of the axes."""
        return self._made({name: getattr(self, name)[rows] for name in self._NAMES})

    def where(self, here: NDArray[np.bool_], other: "_Side") -> "_Side":
        """Own constants where `here`, those of `other` elsewhere."""
        return self._made(
            {
                name: np.where(here, getattr(self, name), getattr(other, name))
                for name in self._NAMES
            }
        )

    def _made(self, values: dict[str, Floats]) -> "_Side":
        side = object.__new__(_Side)
        side.__dict__.update(values)
        return side


def _glide(
    position_m: Floats,
    velocity_m_s: Floats,
    start_m_s2: Floats,
    time_s: Floats,
    side: _Side,
    inertia: Floats,
) -> tuple[Floats, Floats]:
    exponent = side.viscous * time_s / inertia
    small = exponent < _SERIES_BELOW
    z = np.where(small, 1.0, exponent)
    fall = -np.expm1(-z)
    y = exponent
    mean_decay = np.where(small, 1 - y / 2 * (1 - y / 3 * (1 - y / 4 * (1 - y / 5))), fall / z)
    series = (1 - y / 3 * (1 - y / 4 * (1 - y / 5 * (1 - y / 6)))) / 2
    mean_travel = np.where(small, series, (z - fall) / (z * z))
    end_m = position_m + velocity_m_s * time_s + start_m_s2 * time_s * time_s * mean_travel
    return end_m, velocity_m_s + start_m_s2 * time_s * mean_decay
