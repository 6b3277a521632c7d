"""The sampled loop: controller, saturation, delay, plant and measurement, period by period.

At sample k the controller sees the measured motion and computes command k. After saturation it
acts `axis.delay_periods` later, over the period [k + delay, k + delay + 1]; before the first
command arrives, `initial_command` acts.
"""

from array import array
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import floor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seamlog.contracts import Axis, Controller

from .compiled import Run, compiled_run
from .controllers.law import LawController
from .coulomb_plant import CoulombPlant
from .plant import Plant, make_plant
from .stribeck_plant import StribeckPlant

Floats = NDArray[np.float64]
Step = Callable[..., tuple[float, float]]


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
    limit = axis.saturation
    asked = (reference.position_m, reference.velocity_m_s, reference.acceleration_m_s2)
    noise_m, noise_m_s = _series(position_noise_m, count), _series(velocity_noise_m_s, count)
    columns = (*asked, noise_m, noise_m_s, _series(disturbance, count))
    start = (
        float(asked[0][0]) if initial_position_m is None else initial_position_m,
        float(asked[1][0]) if initial_velocity_m_s is None else initial_velocity_m_s,
    )
    loop = _compiled(controller, plant) or _run
    rows, states = loop(
        controller,
        plant,
        np.column_stack(columns),
        start,
        [initial_command] * axis.delay_periods,
        limit,
        encoder_step_m,
    )
    position_m, velocity_m_s, wanted_command = rows.T
    counted_m = position_m
    if encoder_step_m:
        counted_m = np.floor(position_m / encoder_step_m + 0.5) * encoder_step_m
    command = np.clip(wanted_command, -limit, limit)
    early = np.full(min(axis.delay_periods, count), initial_command)
    return ClosedLoop(
        position_m=position_m,
        velocity_m_s=velocity_m_s,
        measured_position_m=counted_m + noise_m,
        measured_velocity_m_s=velocity_m_s + noise_m_s,
        command=command,
        applied_command=np.concatenate([early, command])[:count],
        saturated=np.abs(wanted_command) > limit,
        states=states,
    )


def _run(
    controller: Controller,
    plant: Plant,
    inputs: Floats,
    start: tuple[float, float],
    waiting: list[float],
    limit: float,
    encoder_step_m: float,
) -> tuple[Floats, Floats]:
    """The loop itself: (position, velocity, wanted command) and states at each sample.

    `inputs` has the columns reference (3), noise of position and of velocity, disturbance.
    """
    output, state = controller.output, controller.state
    step: Step = plant.step
    if isinstance(plant, CoulombPlant | StribeckPlant):
        kernel: Step = plant.kernel
        step = partial(kernel, plant.constants)  # a call less per period
    position, velocity = start
    under_way = deque(waiting)
    send, arrive = under_way.append, under_way.popleft
    rows: list[float] = []
    states: list[float] = []
    log, log_state = rows.extend, states.extend
    for asked_m, asked_m_s, asked_m_s2, off_m, off_m_s, push in inputs.tolist():
        seen_m = off_m + (
            floor(position / encoder_step_m + 0.5) * encoder_step_m if encoder_step_m else position
        )
        wanted = output(asked_m, asked_m_s, asked_m_s2, seen_m, velocity + off_m_s)
        log((position, velocity, wanted))
        log_state(state())
        send(limit if wanted > limit else -limit if wanted < -limit else wanted)
        position, velocity = step(position, velocity, arrive(), push)
    return _table(rows, len(inputs)), _table(states, len(inputs))


def _compiled(controller: Controller, plant: Plant) -> Run | None:
    """The same loop as machine code, where controller and plant are pure functions of numbers."""
    if not isinstance(controller, LawController):
        return None
    if not isinstance(plant, CoulombPlant | StribeckPlant):
        return None
    return compiled_run(controller.law, plant.kernel)


def _series(values: ArrayLike, count: int) -> Floats:
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (count,))


def _table(values: list[float], rows: int) -> Floats:
    """Numbers one after the other as a table; `array` takes a list faster than numpy does."""
    return np.array(array("d", values)).reshape(rows, len(values) // max(rows, 1))
