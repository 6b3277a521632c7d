"""The compiled loop says what the interpreted one says, to the bit."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from seamlog import plugins
from seamlog.analysis.closed_loop import ClosedLoop, simulate
from seamlog.analysis.compiled import compiled_run
from seamlog.analysis.controllers.guard import GuardedController
from seamlog.analysis.controllers.law import LawController
from seamlog.analysis.coulomb_plant import coulomb_step
from seamlog.analysis.stribeck_plant import Ripple, StribeckPlant

from .axis_bench import AXIS, COULOMB_AXIS, ENCODER_STEP_M, PERIOD_S, sine, speed_noise

COUNT = 300
LAWS = ("paper", "pd", "pid", "smc_sgn", "super_twisting")
LEANING = replace(
    AXIS, offset=0.05, viscous_friction_negative=2.5, coulomb_friction_negative=0.3, saturation=0.6
)
AXES = {
    "Coulomb": COULOMB_AXIS,
    "Stribeck": AXIS,
    "asymmetric, saturated": LEANING,
    "power 2": replace(AXIS, stribeck_power=2.0),
    "power 0.7": replace(AXIS, stribeck_power=0.7),
    "no delay": replace(COULOMB_AXIS, delay_periods=0),
    "three periods of delay": replace(COULOMB_AXIS, delay_periods=3),
}


def made(name: str, axis: Any) -> Any:
    factory = plugins.load("seamlog.controllers", name)
    values = {"feed_forward": True} if name in ("pd", "pid") else {}
    return factory(factory.Config.model_validate(values), axis, PERIOD_S)


def run(controller: Any, axis: Any, **given: Any) -> ClosedLoop:
    return simulate(
        controller,
        axis,
        sine(0.05, 1.5, COUNT),
        PERIOD_S,
        velocity_noise_m_s=speed_noise(1, COUNT),
        position_noise_m=1e-3 * speed_noise(2, COUNT),
        disturbance=0.05 * np.sin(0.1 * np.arange(COUNT)),
        encoder_step_m=ENCODER_STEP_M,
        initial_command=0.1,
        **given,
    )


def assert_same(compiled: ClosedLoop, interpreted: ClosedLoop) -> None:
    for name in ClosedLoop.__slots__:
        ours, theirs = getattr(compiled, name), getattr(interpreted, name)
        assert np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f"), name


@pytest.mark.parametrize("title", AXES)
@pytest.mark.parametrize("name", LAWS)
def test_every_column_is_the_same_to_the_bit(name: str, title: str) -> None:
    axis = AXES[title]
    controller = made(name, axis)
    compiled = run(controller, axis)
    fenced = GuardedController(made(name, axis), PERIOD_S, name)  # a fence is never compiled
    assert_same(compiled, run(fenced, axis))
    assert controller.state() == fenced.state()


def test_a_second_run_goes_on_with_the_memory_of_the_first() -> None:
    ours, theirs = made("pid", AXIS), GuardedController(made("pid", AXIS), PERIOD_S, "pid")
    for controller in (ours, theirs):
        run(controller, AXIS)
    assert_same(run(ours, AXIS), run(theirs, AXIS))


def test_ripple_is_in_the_compiled_plant() -> None:
    plant = StribeckPlant(AXIS, PERIOD_S, 8, Ripple(0.03, 0.01))
    rippled = run(made("paper", AXIS), AXIS, plant=plant)
    fenced = GuardedController(made("paper", AXIS), PERIOD_S, "paper")
    slow = run(fenced, AXIS, plant=plant)
    assert np.allclose(rippled.position_m, slow.position_m, rtol=0, atol=1e-12)
    assert not np.allclose(rippled.position_m, run(made("paper", AXIS), AXIS).position_m)


def nan_law(gains: tuple[float], memory: tuple[float], *motion: float) -> tuple[float, Any]:
    return gains[0], memory


class Constant(LawController):
    law = staticmethod(nan_law)
    state_names = ("nothing",)


def test_a_command_that_is_no_number_stays_none() -> None:
    loop = simulate(
        Constant(AXIS, PERIOD_S, (math.nan,)), COULOMB_AXIS, sine(0.1, 1.0, 5), PERIOD_S
    )
    assert np.isnan(loop.position_m[2:]).all()


def test_where_numba_is_missing_there_is_no_compiled_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("seamlog.analysis.compiled.find_spec", lambda _: None)
    assert compiled_run.__wrapped__(nan_law, coulomb_step) is None


@pytest.mark.parametrize("name", sorted(plugins.available("seamlog.controllers")))
def test_laws_are_the_controllers_that_can_be_compiled(name: str) -> None:
    assert issubclass(plugins.load("seamlog.controllers", name), LawController) == (name in LAWS)
