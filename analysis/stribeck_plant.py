"""Stribeck friction and pitch ripple, in sub-steps of the period: scalar, one axis."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from seamlog.contracts import Axis

from .deterministic import exponential
from .dynamics import backward_axis
from .friction import stribeck_rise


@dataclass(frozen=True, slots=True)
class Ripple:
    """Force that repeats with the screw: amplitude sin(2 pi x / pitch), in the command unit."""

    amplitude: float
    pitch_m: float


class SlidingSide(NamedTuple):
    """Friction in one direction, as the change of speed over a sub-step."""

    damping: float
    level: float
    excess: float
    speed_m_s: float
    power: float


class StribeckConstants(NamedTuple):
    """What `stribeck_step` knows of an axis and its sub-step."""

    forward: SlidingSide
    backward: SlidingSide
    substeps: int
    step_s: float
    gain: float
    offset: float
    ripple: float
    pitch_m: float


def _sliding_side(axis: Axis, gain: float) -> SlidingSide:
    excess = gain * max(0.0, axis.static_friction - axis.coulomb_friction)
    speed_m_s = axis.stribeck_speed_m_s if excess > 0.0 else 0.0
    damping, level = 1.0 + gain * axis.viscous_friction, gain * axis.coulomb_friction
    return SlidingSide(damping, level, excess, speed_m_s, axis.stribeck_power)


def stribeck_step(
    plant: StribeckConstants,
    position_m: float,
    velocity_m_s: float,
    command: float,
    disturbance: float,
) -> tuple[float, float]:
    """Position and velocity one period later; see `StribeckPlant`."""
    gain, half_s, ripple = plant.gain, 0.5 * plant.step_s, plant.ripple
    force = command - plant.offset - disturbance
    for _ in range(plant.substeps):
        push = force
        if ripple != 0.0:
            push = force - ripple * math.sin(2.0 * math.pi * position_m / plant.pitch_m)
        impulse = velocity_m_s + gain * push
        side = plant.forward if impulse > 0.0 else plant.backward
        hold = _hold(side, velocity_m_s if velocity_m_s >= 0.0 else -velocity_m_s)
        if impulse > hold:
            next_m_s = (impulse - hold) / side.damping
        elif impulse < -hold:
            next_m_s = (impulse + hold) / side.damping
        else:
            next_m_s = 0.0 if impulse == impulse else impulse
        position_m += half_s * (velocity_m_s + next_m_s)
        velocity_m_s = next_m_s
    return position_m, velocity_m_s


def _hold(side: SlidingSide, speed_m_s: float) -> float:
    """Gain times `sliding_friction`; beyond 40 Stribeck speeds nothing of the rise is left."""
    if side.speed_m_s == 0.0:
        return side.level
    if side.power == 1.0:
        if speed_m_s >= 40.0 * side.speed_m_s:
            return side.level
        return side.level + side.excess * exponential(-speed_m_s / side.speed_m_s)
    return side.level + side.excess * stribeck_rise(speed_m_s / side.speed_m_s, side.power)


class StribeckPlant:
    """Stribeck friction (eq. 2), stepped implicitly in `substeps` parts of the period.

    The friction level is taken at the start of a sub-step, its sign and the stick are implicit,
    so the step is stable for any friction. `ripple` depends on the position.
    """

    kernel = staticmethod(stribeck_step)

    def __init__(
        self, axis: Axis, period_s: float, substeps: int = 0, ripple: Ripple | None = None
    ) -> None:
        substeps = substeps or max(1, round(period_s / 1e-3))
        step_s = period_s / substeps
        gain = step_s / axis.inertia
        sides = (_sliding_side(axis, gain), _sliding_side(backward_axis(axis), gain))
        wave = ripple or Ripple(0.0, 1.0)
        self.constants = StribeckConstants(
            *sides, substeps, step_s, gain, axis.offset, wave.amplitude, wave.pitch_m
        )

    def step(
        self, position_m: float, velocity_m_s: float, command: float, disturbance: float = 0.0
    ) -> tuple[float, float]:
        """Position and velocity one period later; error of the order of the sub-step."""
        return stribeck_step(self.constants, position_m, velocity_m_s, command, disturbance)
