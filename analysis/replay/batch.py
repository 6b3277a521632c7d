"""Many closed loops side by side: each with a controller and an axis of its own.

The laws run one by one, as the live loop ran them; the axes are stepped together, in sub-steps:
friction level at their start, ripple and viscous friction at their middle, sign and stick implicit.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.closed_loop import ClosedLoop, Reference
from seamlog.contracts import Axis, Controller

from .model import RippleForce

Floats = NDArray[np.float64]
SUBSTEP_S = 0.005
FAR_M = 1e3
"""A loop that gets this far has run away; it is kept there, so that numbers stay finite."""


@dataclass(frozen=True)
class World:
    """Everything around one controller: axis, ripple, load (n,) and noise of the speed (n,)."""

    axis: Axis
    ripple: RippleForce
    disturbance: Floats
    velocity_noise_m_s: Floats


@dataclass(frozen=True)
class Start:
    """State before the first sample and the step of the encoder, m and m/s."""

    position_m: float
    velocity_m_s: float
    encoder_step_m: float


class _Axes:
    """Axes stepped together by control periods; every array of shape (members,)."""

    def __init__(self, worlds: Sequence[World], period_s: float) -> None:
        def of(name: str) -> Floats:
            return np.array([getattr(world.axis, name) for world in worlds], dtype=np.float64)

        self._substeps = max(1, round(period_s / SUBSTEP_S))
        self._step_s = period_s / self._substeps
        self._gain = self._step_s / of("inertia")
        self._damping = 0.5 * self._gain * of("viscous_friction")
        self._offset, self._level = of("offset"), self._gain * of("coulomb_friction")
        self._excess = np.maximum(0.0, self._gain * of("static_friction") - self._level)
        speed, self._power = of("stribeck_speed_m_s"), of("stribeck_power")
        self._slowness = np.where(speed > 0, 1.0 / np.where(speed > 0, speed, 1.0), np.inf)
        self._excess = np.where(speed > 0, self._excess, 0.0)
        self._slowness = np.where(speed > 0, self._slowness, 0.0)
        self._plain = bool(np.all(self._power == 1.0))
        self._wave = np.array([2 * np.pi / world.ripple.pitch_m for world in worlds])
        sine = np.array([world.ripple.sine for world in worlds])
        cosine = np.array([world.ripple.cosine for world in worlds])
        self._amplitude, self._phase = np.hypot(sine, cosine), np.arctan2(cosine, sine)
        self._rippled = bool(np.any(self._amplitude > 0))

    def step(
        self, position_m: Floats, velocity_m_s: Floats, command: Floats, load: Floats
    ) -> tuple[Floats, Floats]:
        force = self._gain * (command - self._offset - load)
        half_s = 0.5 * self._step_s
        for _ in range(self._substeps):
            impulse = velocity_m_s * (1.0 - self._damping) + force
            if self._rippled:
                angle = self._wave * (position_m + half_s * velocity_m_s) + self._phase
                impulse -= self._gain * self._amplitude * np.sin(angle)
            ratio = np.abs(velocity_m_s) * self._slowness
            ratio = ratio if self._plain else ratio**self._power
            hold = self._level + self._excess * np.exp(-ratio)
            after = (impulse - np.clip(impulse, -hold, hold)) / (1.0 + self._damping)
            position_m = position_m + half_s * (velocity_m_s + after)
            velocity_m_s = after
        return position_m, velocity_m_s


@dataclass(frozen=True)
class Runs:
    """`position_m` of all members, shape (members, n); `watched` in full."""

    position_m: Floats
    watched: dict[int, ClosedLoop]


def simulate_worlds(
    controllers: Sequence[Controller],
    worlds: Sequence[World],
    reference: Reference,
    period_s: float,
    start: Start,
    watched: Sequence[int] = (),
) -> Runs:
    """Run `controllers[i]` in `worlds[i]` along `reference`; all axes have one delay."""
    axes, count = _Axes(worlds, period_s), len(reference.position_m)
    outputs = [controller.output for controller in controllers]
    limit = np.array([world.axis.saturation for world in worlds])
    noise = np.array([world.velocity_noise_m_s for world in worlds]).T
    load = np.array([world.disturbance for world in worlds]).T
    asked = np.column_stack(
        [reference.position_m, reference.velocity_m_s, reference.acceleration_m_s2]
    ).tolist()
    waiting = [np.zeros(len(worlds))] * worlds[0].axis.delay_periods
    position = np.full(len(worlds), start.position_m)
    velocity = np.full(len(worlds), start.velocity_m_s)
    positions = np.empty((count, len(worlds)))
    log = _Log(watched, controllers, count)
    step_m = start.encoder_step_m
    for k, (asked_m, asked_m_s, asked_m_s2) in enumerate(asked):
        seen_m = np.floor(position / step_m + 0.5) * step_m if step_m else position
        seen_m_s = velocity + noise[k]
        seen = zip(outputs, seen_m.tolist(), seen_m_s.tolist(), strict=True)
        wanted = np.array(
            [law(asked_m, asked_m_s, asked_m_s2, x, v) for law, x, v in seen], dtype=np.float64
        )
        command = np.minimum(np.maximum(wanted, -limit), limit)
        waiting.append(command)
        applied = waiting.pop(0)
        positions[k] = position
        log.take(k, (position, velocity, seen_m, seen_m_s, command, applied, wanted))
        position, velocity = axes.step(position, velocity, applied, load[k])
        position = np.minimum(np.maximum(position, -FAR_M), FAR_M)
        velocity = np.minimum(np.maximum(velocity, -FAR_M), FAR_M)
    return Runs(positions.T, log.runs(limit))


class _Log:
    """Full columns of the watched members."""

    def __init__(
        self, watched: Sequence[int], controllers: Sequence[Controller], count: int
    ) -> None:
        self._places = list(watched)
        self._states = [controllers[i].state for i in watched]
        self._columns = np.empty((count, 7, len(self._places)))
        self._rows: list[list[tuple[float, ...]]] = [[] for _ in watched]

    def take(self, k: int, values: tuple[Floats, ...]) -> None:
        for place, column in enumerate(values):
            self._columns[k, place] = column[self._places]
        for rows, state in zip(self._rows, self._states, strict=True):
            rows.append(tuple(state()))

    def runs(self, limit: Floats) -> dict[int, ClosedLoop]:
        return {place: self._run(i, limit[place]) for i, place in enumerate(self._places)}

    def _run(self, i: int, limit: float) -> ClosedLoop:
        columns = self._columns[:, :, i].T
        return ClosedLoop(
            position_m=columns[0],
            velocity_m_s=columns[1],
            measured_position_m=columns[2],
            measured_velocity_m_s=columns[3],
            command=columns[4],
            applied_command=columns[5],
            saturated=np.abs(columns[6]) > limit,
            states=np.array(self._rows[i], dtype=np.float64).reshape(len(columns[0]), -1),
        )
