import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seamlog.analysis.closed_loop import simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.coulomb_plant import CoulombPlant
from seamlog.analysis.dynamics import axis_from_datasheet
from seamlog.analysis.friction import friction_shape, sliding_friction, smallest_dead_zone_m_s
from seamlog.analysis.stribeck_plant import Ripple, StribeckPlant
from seamlog.contracts import Axis

from .axis_bench import AXIS, COULOMB_AXIS, PERIOD_S, sine

speeds = st.floats(-0.5, 0.5)
commands = st.floats(-5.0, 5.0)
axes = st.builds(
    Axis,
    inertia=st.floats(0.1, 50.0),
    viscous_friction=st.just(0.0) | st.floats(1e-9, 200.0),
    coulomb_friction=st.floats(0.0, 3.0),
    offset=st.floats(-1.0, 1.0),
    static_friction=st.floats(0.0, 3.0),
)


def kinetic_energy(axis: Axis, velocity_m_s: float) -> float:
    return 0.5 * axis.inertia * velocity_m_s**2


def test_exact_step_agrees_with_fine_integration_in_the_loop() -> None:
    reference = sine(0.1, 1.0, 100)
    exact, fine = (
        simulate(
            PaperController(PaperConfig(), COULOMB_AXIS, PERIOD_S),
            COULOMB_AXIS,
            reference,
            PERIOD_S,
            plant=plant,
        )
        for plant in (None, StribeckPlant(COULOMB_AXIS, PERIOD_S, substeps=4000))
    )
    assert (exact.velocity_m_s < 0).any()
    assert np.abs(exact.position_m - fine.position_m).max() < 1e-7


@given(axes, speeds, commands)
def test_two_half_periods_make_one_period(axis: Axis, velocity: float, command: float) -> None:
    whole, half = CoulombPlant(axis, PERIOD_S), CoulombPlant(axis, PERIOD_S / 2)
    at_once = whole.step(0.1, velocity, command)
    in_parts = half.step(*half.step(0.1, velocity, command), command)
    assert at_once == pytest.approx(in_parts, rel=1e-9, abs=1e-12)


@given(axes, speeds, commands)
def test_the_plant_is_the_same_both_ways(axis: Axis, velocity: float, command: float) -> None:
    forth = CoulombPlant(axis, PERIOD_S).step(0.02, velocity, command)
    mirrored = replace(axis, offset=-axis.offset)
    back = CoulombPlant(mirrored, PERIOD_S).step(-0.02, -velocity, -command)
    assert forth == (-back[0], -back[1])


@given(axes, speeds)
def test_without_force_energy_falls_and_rest_is_kept(axis: Axis, velocity: float) -> None:
    axis = replace(axis, offset=0.0)
    for plant in (CoulombPlant(axis, PERIOD_S), StribeckPlant(axis, PERIOD_S, substeps=8)):
        _, end = plant.step(0.0, velocity, 0.0)
        assert kinetic_energy(axis, end) <= kinetic_energy(axis, velocity) * (1 + 1e-12)
        assert end * velocity >= 0.0
        assert plant.step(0.3, 0.0, 0.0) == (0.3, 0.0)


@given(st.floats(-1.0, 1.0))
def test_static_friction_holds_the_table_until_it_is_exceeded(share: float) -> None:
    plant = CoulombPlant(AXIS, PERIOD_S)
    assert plant.step(0.01, 0.0, share * AXIS.static_friction) == (0.01, 0.0)
    moved, velocity = plant.step(0.01, 0.0, 1.001 * AXIS.static_friction)
    assert moved > 0.01 and velocity > 0.0


def test_a_table_stopped_within_the_period_sticks_or_turns_back() -> None:
    plant = CoulombPlant(COULOMB_AXIS, PERIOD_S)
    assert plant.step(0.0, 0.002, -0.1)[1] == 0.0
    assert plant.step(0.0, 0.002, -2.0)[1] < 0.0


def test_disturbance_and_offset_oppose_the_command() -> None:
    shifted = replace(COULOMB_AXIS, offset=0.2)
    plain = CoulombPlant(COULOMB_AXIS, PERIOD_S)
    assert CoulombPlant(shifted, PERIOD_S).step(0.0, 0.1, 1.0) == plain.step(0.0, 0.1, 1.0, 0.2)


def test_stribeck_friction_falls_from_static_to_coulomb() -> None:
    assert sliding_friction(AXIS, 0.0) == AXIS.static_friction
    assert sliding_friction(AXIS, 1.0) == AXIS.coulomb_friction
    at_v_s = sliding_friction(AXIS, AXIS.stribeck_speed_m_s)
    assert at_v_s == pytest.approx(0.214 + 0.043 * math.exp(-1.0))
    powered = replace(AXIS, stribeck_power=1.5)
    assert sliding_friction(powered, 0.004) == pytest.approx(0.214 + 0.043 * math.exp(-(2**1.5)))


@given(st.floats(-0.3, 0.3), st.sampled_from([0.5, 1.0, 2.0]), st.floats(-3.0, 3.0))
def test_a_sub_step_takes_the_level_of_friction_at_its_start(
    velocity: float, power: float, command: float
) -> None:
    axis = replace(AXIS, stribeck_power=power)
    step_s = 1e-3
    _, after = StribeckPlant(axis, step_s, substeps=1).step(0.0, velocity, command)
    impulse = velocity + step_s * command
    hold = step_s * sliding_friction(axis, abs(velocity))
    expected = math.copysign(max(abs(impulse) - hold, 0.0), impulse)
    assert after == pytest.approx(expected / (1 + step_s * axis.viscous_friction), abs=1e-15)


@pytest.mark.parametrize("make", [CoulombPlant, StribeckPlant])
def test_friction_may_differ_by_direction(make: type[CoulombPlant] | type[StribeckPlant]) -> None:
    there = replace(COULOMB_AXIS, viscous_friction=3.0, coulomb_friction=0.5)
    back = replace(COULOMB_AXIS, viscous_friction=1.0, coulomb_friction=0.1)
    both = replace(there, viscous_friction_negative=1.0, coulomb_friction_negative=0.1)
    plant, forward, backward = (make(axis, PERIOD_S) for axis in (both, there, back))
    for velocity, command in ((0.05, 1.0), (0.0, 0.6), (0.2, -1.0)):
        assert plant.step(0.0, velocity, command) == forward.step(0.0, velocity, command)
        assert plant.step(0.0, -velocity, -command) == backward.step(0.0, -velocity, -command)
    assert plant.step(0.0, 0.0, 0.3) == (0.0, 0.0)
    assert plant.step(0.0, 0.0, -0.3)[1] < 0.0


def test_a_turn_meets_the_friction_of_both_directions() -> None:
    axis = replace(COULOMB_AXIS, viscous_friction_negative=4.0, coulomb_friction_negative=0.5)
    exact = CoulombPlant(axis, PERIOD_S).step(0.0, 0.02, -2.0)
    fine = StribeckPlant(axis, PERIOD_S, substeps=40_000).step(0.0, 0.02, -2.0)
    assert exact[1] < 0.0
    assert exact == pytest.approx(fine, abs=1e-6)


def test_smallest_dead_zone_has_the_published_ratios() -> None:
    assert smallest_dead_zone_m_s(AXIS) == pytest.approx(3.48 * 0.002, rel=1e-3)
    gaussian = replace(AXIS, stribeck_power=2.0)
    assert smallest_dead_zone_m_s(gaussian) == pytest.approx(1.353 * 0.002, rel=1e-3)
    assert smallest_dead_zone_m_s(COULOMB_AXIS) == 0.0


@given(st.floats(-1e3, 1e3), st.floats(1e-4, 0.1))
def test_friction_shape_is_equation_3(velocity: float, dead_zone: float) -> None:
    expected = 2.0 / math.pi * math.atan((velocity / dead_zone) ** 9)
    assert friction_shape(velocity, dead_zone) == pytest.approx(expected, rel=1e-13, abs=1e-300)


def test_ripple_pushes_with_the_pitch_of_the_screw() -> None:
    ripple = Ripple(amplitude=0.5, pitch_m=0.01)
    plant = StribeckPlant(COULOMB_AXIS, PERIOD_S, ripple=ripple)
    quarter, three_quarters = 0.0025, 0.0075
    assert plant.step(quarter, 0.0, 0.0)[1] < 0.0 < plant.step(three_quarters, 0.0, 0.0)[1]


def test_datasheet_values_become_what_the_motor_sees() -> None:
    lead_m = 0.01
    ratio_m = lead_m / (2 * math.pi)
    axis = axis_from_datasheet(
        motor_inertia_kg_m2=1e-4,
        screw_inertia_kg_m2=2e-4,
        load_kg=40.0,
        lead_m=lead_m,
        viscous_friction_n_s_m=90.0,
        coulomb_friction_n=6.0,
    )
    assert axis.inertia == pytest.approx(3e-4 / ratio_m + 40.0 * ratio_m)
    assert axis.viscous_friction == pytest.approx(90.0 * ratio_m)
    assert axis.coulomb_friction == pytest.approx(6.0 * ratio_m)
    assert axis.unit == "N m"


@pytest.mark.parametrize("make", [CoulombPlant, StribeckPlant])
@pytest.mark.parametrize(
    "state", [(math.nan, 0.1, 1.0), (0.0, math.nan, 0.0), (0.0, 0.0, math.nan)]
)
def test_what_is_not_a_number_never_becomes_one(
    make: type[CoulombPlant] | type[StribeckPlant], state: tuple[float, float, float]
) -> None:
    assert math.isnan(make(COULOMB_AXIS, PERIOD_S).step(*state)[0])
    if not math.isnan(state[0]):
        assert math.isnan(make(COULOMB_AXIS, PERIOD_S).step(*state)[1])
