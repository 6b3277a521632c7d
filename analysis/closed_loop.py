"""The sampled loop: controller, saturation, delay, plant and measurement, period by period.

At sample k the controller sees the measured motion and computes command k. After saturation it
acts `axis.delay_periods` later, over the period [k + delay, k + delay + 1]; before the first
command arrives, `initial_command` acts.
"""

from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seamlog.contracts import Axis, Controller

from .dynamics import Plant, make_plant

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Reference:
    """Motion asked for at each sample: m, m/s, m/s^2, each of shape (n,)."""

    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """One run of the loop, each array of shape (n,); `command` is after saturation.

    `applied_command[k]` acted over the period [k, k + 1]. `states` has the controller's state
    after each sample, shape (n, len(state_names)).
    """

    position_m: Floats
    velocity_m_s: Floats
    measured_position_m: Floats
    measured_velocity_m_s: Floats
    command: Floats
    applied_command: Floats
    saturated: NDArray[np.bool_]
    states: Floats

    def tracking_error_m(self, reference: Reference) -> Floats:
        """Reference minus true position."""
        return reference.position_m - self.position_m


def simulate(
    controller: Controller,
    axis: Axis,
    reference: Reference,
    period_s: float,
    *,
    plant: Plant | None = None,
    position_noise_m: ArrayLike = 0.0,
    velocity_noise_m_s: ArrayLike = 0.0,
    disturbance: ArrayLike = 0.0,
    encoder_step_m: float = 0.0,
    initial_position_m: float | None = None,
    initial_velocity_m_s: float | None = None,
    initial_command: float = 0.0,
) -> ClosedLoop:
    """Run `controller` in closed loop along `reference`.

    Noise and disturbance are scalars or arrays of shape (n,): noise is added to the true motion
    at each sample, disturbance (command unit, opposing a positive command) acts over the period
    that follows it. The loop starts on the reference unless told otherwise. `plant` replaces the
    plant that fits `axis`; saturation and delay are always those of `axis`.
    """
    count = reference.position_m.shape[0]
    plant = plant or make_plant(axis, period_s)
    step, output, state = plant.step, controller.output, controller.state
    limit = axis.saturation
    asked_m = reference.position_m.tolist()
    asked_m_s = reference.velocity_m_s.tolist()
    asked_m_s2 = reference.acceleration_m_s2.tolist()
    noise_m, noise_m_s = _series(position_noise_m, count), _series(velocity_noise_m_s, count)
    load = _series(disturbance, count)
    position = asked_m[0] if initial_position_m is None else initial_position_m
    velocity = asked_m_s[0] if initial_velocity_m_s is None else initial_velocity_m_s
    waiting = [initial_command] * axis.delay_periods
    rows: list[tuple[float, float, float, float, float, float, float]] = []
    states = []
    for k in range(count):
        seen_m = noise_m[k] + (
            floor(position / encoder_step_m + 0.5) * encoder_step_m if encoder_step_m else position
        )
        seen_m_s = velocity + noise_m_s[k]
        wanted = output(asked_m[k], asked_m_s[k], asked_m_s2[k], seen_m, seen_m_s)
        command = limit if wanted > limit else -limit if wanted < -limit else wanted
        waiting.append(command)
        applied = waiting.pop(0)
        rows.append((position, velocity, seen_m, seen_m_s, command, applied, wanted))
        states.append(state())
        position, velocity = step(position, velocity, applied, load[k])
    columns = np.array(rows, dtype=np.float64).reshape(count, 7).T
    return ClosedLoop(
        position_m=columns[0],
        velocity_m_s=columns[1],
        measured_position_m=columns[2],
        measured_velocity_m_s=columns[3],
        command=columns[4],
        applied_command=columns[5],
        saturated=np.abs(columns[6]) > limit,
        states=np.array(states, dtype=np.float64).reshape(count, -1),
    )


def _series(values: ArrayLike, count: int) -> list[float]:
    return list(np.broadcast_to(np.asarray(values, dtype=np.float64), (count,)).tolist())
