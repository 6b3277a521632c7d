"""A batch says what one run after another says."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from seamlog.analysis.batch import BatchLaw, simulate_batch
from seamlog.analysis.batch_plant import CoulombPlants
from seamlog.analysis.closed_loop import Reference, simulate
from seamlog.analysis.controllers.batched import BatchedPaper, BatchedPID
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.controllers.pid import PID, PIDConfig
from seamlog.analysis.coulomb_plant import CoulombPlant
from seamlog.contracts import Axis, Controller
from seamlog.errors import UsageError

from .axis_bench import COULOMB_AXIS, PERIOD_S, sine, speed_noise

COUNT = 24


def axes(random: np.random.Generator, delay: int) -> list[Axis]:
    return [
        Axis(
            inertia=random.uniform(0.3, 3.0),
            viscous_friction=random.choice([0.0, random.uniform(0.1, 5.0)]),
            coulomb_friction=random.choice([0.0, random.uniform(0.05, 0.5)]),
            offset=random.uniform(-0.2, 0.2),
            static_friction=random.uniform(0.0, 0.6),
            saturation=random.choice([1.0, np.inf]),
            delay_periods=delay,
            viscous_friction_negative=random.choice(np.array([None, 3.0])),
            coulomb_friction_negative=random.choice(np.array([None, 0.3])),
        )
        for _ in range(COUNT)
    ]


def papers(random: np.random.Generator) -> list[PaperConfig]:
    return [
        PaperConfig(
            surface_slope=random.uniform(2, 6),
            gain=random.choice(np.array([None, 0.2])),
            boundary_layer=random.uniform(0.05, 0.2),
            reach_rate=random.uniform(0, 0.1),
            form="right" if k % 2 else "as_printed",
            friction_speed="measured" if k % 3 else "reference",
        )
        for k in range(COUNT)
    ]


def pids(random: np.random.Generator) -> list[PIDConfig]:
    return [
        PIDConfig(
            kp=random.choice(np.array([None, 20.0])),
            ki=random.uniform(0, 20),
            kd=random.uniform(4, 8),
            integral_limit=random.choice(np.array([None, 0.1])),
            feed_forward=bool(k % 2),
        )
        for k in range(COUNT)
    ]


def paper_pair(
    random: np.random.Generator, made: list[Axis]
) -> tuple[BatchLaw, Callable[[int], Controller]]:
    configs = papers(random)
    return BatchedPaper(configs, made), lambda i: PaperController(configs[i], made[i], PERIOD_S)


def pid_pair(
    random: np.random.Generator, made: list[Axis]
) -> tuple[BatchLaw, Callable[[int], Controller]]:
    configs = pids(random)
    batched = BatchedPID(configs, made, PERIOD_S)
    return batched, lambda i: PID(configs[i], made[i], PERIOD_S)


@pytest.mark.parametrize("pair", [paper_pair, pid_pair])
@pytest.mark.parametrize("delay", [0, 1, 2])
def test_every_configuration_moves_as_it_does_alone(
    pair: Callable[..., tuple[BatchLaw, Callable[[int], Controller]]], delay: int
) -> None:
    random = np.random.default_rng(delay)
    made = axes(random, delay)
    law, alone = pair(random, made)
    reference, noise = sine(0.1, 0.6, 700), speed_noise(delay, 700)
    load = 0.05 * np.sin(np.arange(700) / 50)
    batch = simulate_batch(
        law,
        made,
        reference,
        PERIOD_S,
        velocity_noise_m_s=noise[:, None],
        disturbance=load[:, None],
    )
    for i, axis in enumerate(made):
        one = simulate(
            alone(i), axis, reference, PERIOD_S, velocity_noise_m_s=noise, disturbance=load
        )
        tame = np.abs(one.position_m).max() < 1.0
        assert tame or delay == 2
        if tame:
            assert np.abs(batch.position_m[:, i] - one.position_m).max() < 1e-9
            assert np.abs(batch.command[:, i] - one.command).max() < 1e-7


def test_one_step_agrees_from_every_state() -> None:
    random = np.random.default_rng(7)
    made = axes(random, 1) * 40
    position = random.uniform(-0.1, 0.1, len(made))
    velocity = random.choice([0.0, 1e-7, -1e-4, 0.01, -0.05, 5e-324], len(made))
    command = random.choice([0.0, 0.2, -0.4, 1.0, -8.0], len(made))
    end_m, end_m_s = CoulombPlants(made, PERIOD_S).step(position, velocity, command, 0.03)
    for i, axis in enumerate(made):
        one = CoulombPlant(axis, PERIOD_S).step(position[i], velocity[i], command[i], 0.03)
        assert (end_m[i], end_m_s[i]) == pytest.approx(one, rel=1e-11, abs=1e-13)


def test_each_configuration_may_have_noise_and_load_of_its_own() -> None:
    law = BatchedPaper([PaperConfig()] * 3, [COULOMB_AXIS] * 3)
    load = np.zeros((400, 3))
    load[:, 2] = 0.1
    run = simulate_batch(
        law,
        [COULOMB_AXIS] * 3,
        sine(0.1, 0.6, 400),
        PERIOD_S,
        disturbance=load,
        encoder_step_m=1e-6,
    )
    assert np.array_equal(run.position_m[:, 0], run.position_m[:, 1])
    assert np.abs(run.position_m[:, 2] - run.position_m[:, 0]).max() > 1e-4


def test_the_error_is_reference_less_position() -> None:
    still = Reference(np.full(3, 0.02), np.zeros(3), np.zeros(3))
    run = simulate_batch(BatchedPaper([PaperConfig()], [COULOMB_AXIS]), [COULOMB_AXIS], still, 0.04)
    assert run.tracking_error_m(still).tolist() == [[0.0], [0.0], [0.0]]


def test_axes_of_different_delay_are_refused() -> None:
    mixed = [COULOMB_AXIS, replace(COULOMB_AXIS, delay_periods=2)]
    with pytest.raises(UsageError, match=r"one delay, got \[1, 2\]"):
        simulate_batch(BatchedPaper([PaperConfig()] * 2, mixed), mixed, sine(0.1, 1.0, 5), 0.04)
