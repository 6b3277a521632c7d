"""The sampled loop for many configurations at once, in numpy; `closed_loop.simulate` runs one.

Saturation, delay, noise and disturbance are as there; the plants are `CoulombPlants`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seamlog.contracts import Axis
from seamlog.errors import UsageError

from .batch_plant import CoulombPlants
from .closed_loop import Reference

Floats = NDArray[np.float64]


class BatchLaw(Protocol):
    """A control law for many configurations: one command each, shape (configurations,)."""

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: Floats,
        velocity_m_s: Floats,
    ) -> Floats:
        """Commands for the next period, before saturation."""
        ...


@dataclass(frozen=True, slots=True)
class BatchRun:
    """Motion and commands (after saturation) at each sample, shape (n, configurations)."""

    position_m: Floats
    velocity_m_s: Floats
    command: Floats

    def tracking_error_m(self, reference: Reference) -> Floats:
        """Reference minus true position."""
        return reference.position_m[:, None] - self.position_m


def simulate_batch(
    law: BatchLaw,
    axes: Sequence[Axis],
    reference: Reference,
    period_s: float,
    *,
    position_noise_m: ArrayLike = 0.0,
    velocity_noise_m_s: ArrayLike = 0.0,
    disturbance: ArrayLike = 0.0,
    encoder_step_m: float = 0.0,
) -> BatchRun:
    """Run `law` on `axes`, one for each of its configurations, all from the reference's start.

    Noise and disturbance are scalars or arrays that broadcast to (n, configurations): shape
    (n, 1) gives all the same. Axes with different delays are refused (`UsageError`).
    """
    delay = _one_delay(axes)
    count, width = len(reference.position_m), len(axes)
    plants = CoulombPlants(axes, period_s)
    limit = np.array([axis.saturation for axis in axes])
    shape = (count, width)
    off_m, off_m_s, load = (
        np.broadcast_to(np.asarray(values, dtype=np.float64), shape)
        for values in (position_noise_m, velocity_noise_m_s, disturbance)
    )
    position = np.full(width, reference.position_m[0])
    velocity = np.full(width, reference.velocity_m_s[0])
    run = BatchRun(np.empty(shape), np.empty(shape), np.empty(shape))
    rows = zip(
        reference.position_m.tolist(),
        reference.velocity_m_s.tolist(),
        reference.acceleration_m_s2.tolist(),
        strict=True,
    )
    waiting = [np.zeros(width)] * delay
    for k, asked in enumerate(rows):
        seen_m = position
        if encoder_step_m:
            seen_m = np.floor(position / encoder_step_m + 0.5) * encoder_step_m
        wanted = law.output(*asked, seen_m + off_m[k], velocity + off_m_s[k])
        command = np.minimum(np.maximum(wanted, -limit), limit)
        run.position_m[k], run.velocity_m_s[k], run.command[k] = position, velocity, command
        waiting.append(command)
        position, velocity = plants.step(position, velocity, waiting.pop(0), load[k])
    return run


def _one_delay(axes: Sequence[Axis]) -> int:
    delays = {axis.delay_periods for axis in axes}
    if len(delays) != 1:
        raise UsageError(f"a batch needs axes of one delay, got {sorted(delays)} periods")
    return delays.pop()
