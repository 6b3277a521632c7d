from collections.abc import Sequence

import numpy as np
import pytest

from seamlog.analysis.closed_loop import Reference, simulate
from seamlog.analysis.coulomb_plant import CoulombPlant
from seamlog.contracts import Axis

from .axis_bench import COULOMB_AXIS, PERIOD_S


class Recited:
    """A controller that says what it was told to."""

    state_names = ("seen_m",)

    def __init__(self, commands: Sequence[float]) -> None:
        self._commands = iter(commands)
        self._seen_m = 0.0

    def output(self, *motion: float) -> float:
        self._seen_m = motion[3]
        return next(self._commands)

    def state(self) -> tuple[float, ...]:
        return (self._seen_m,)


def still(count: int) -> Reference:
    return Reference(np.zeros(count), np.zeros(count), np.zeros(count))


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_command_acts_after_the_delay_and_within_saturation(delay: int) -> None:
    axis = Axis(1.0, 0.0, 0.1, saturation=2.0, delay_periods=delay)
    run = simulate(Recited([5.0, -1.0, 0.0, 0.0, 0.0]), axis, still(5), 0.1, initial_command=0.05)
    assert run.command.tolist() == [2.0, -1.0, 0.0, 0.0, 0.0]
    assert run.saturated.tolist() == [True, False, False, False, False]
    assert run.applied_command.tolist() == [*[0.05] * delay, 2.0, -1.0, 0.0, 0.0, 0.0][:5]
    assert np.flatnonzero(run.position_m)[0] == delay + 1


def test_measurements_carry_noise_and_steps_and_the_motion_does_not() -> None:
    commands = [1.0] * 20
    quiet = simulate(Recited(commands), COULOMB_AXIS, still(20), PERIOD_S)
    noise = 1e-4 * np.arange(20)
    noisy = simulate(
        Recited(commands),
        COULOMB_AXIS,
        still(20),
        PERIOD_S,
        position_noise_m=noise,
        velocity_noise_m_s=0.01,
        encoder_step_m=1e-3,
    )
    assert np.array_equal(quiet.position_m, noisy.position_m)
    assert np.allclose(noisy.measured_velocity_m_s - noisy.velocity_m_s, 0.01)
    counts = (noisy.measured_position_m - noise) / 1e-3
    assert np.allclose(counts, np.rint(quiet.position_m / 1e-3))
    assert np.array_equal(noisy.states[:, 0], noisy.measured_position_m)


def test_disturbance_acts_over_the_period_after_its_sample() -> None:
    load = np.zeros(6)
    load[2] = -3.0
    run = simulate(Recited([0.0] * 6), COULOMB_AXIS, still(6), PERIOD_S, disturbance=load)
    moved = CoulombPlant(COULOMB_AXIS, PERIOD_S).step(0.0, 0.0, 3.0)
    assert run.velocity_m_s.tolist()[:3] == [0.0, 0.0, 0.0]
    assert (run.position_m[3], run.velocity_m_s[3]) == moved
