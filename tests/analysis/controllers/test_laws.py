"""What each law must do on its own: analytic answers, named states, limits that are told."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from seamlog import plugins
from seamlog.analysis.closed_loop import ClosedLoop, Reference, simulate
from seamlog.analysis.controllers.adrc import ADRC, ADRCConfig
from seamlog.analysis.controllers.lqr import LQR, LQRConfig, design
from seamlog.analysis.controllers.pid import PID, PIDConfig
from seamlog.analysis.controllers.riccati import regulator_gains
from seamlog.analysis.controllers.smc_sgn import SignConfig, SignController
from seamlog.analysis.controllers.stability import loop_radius
from seamlog.analysis.controllers.super_twisting import SuperTwisting, SuperTwistingConfig
from seamlog.contracts import Axis
from seamlog.errors import UsageError
from tests.analysis.axis_bench import AXIS, COULOMB_AXIS, PERIOD_S, sine

SMOOTH_AXIS = Axis(2.0, 1.0, 0.0, delay_periods=1)
LAWS = ("adaptive", "adrc", "lqr", "paper", "pd", "pid", "smc_sgn", "super_twisting")
WRAPPERS = ("disturbance_observer", "predictor")


def make(name: str, axis: Axis = AXIS, **values: Any) -> Any:
    factory = plugins.load("seamlog.controllers", name)
    return factory(factory.Config.model_validate(values), axis, PERIOD_S)


def still(count: int) -> Reference:
    return Reference(np.zeros(count), np.zeros(count), np.zeros(count))


def pushed(controller: Any, axis: Axis, force: float, count: int = 1500) -> ClosedLoop:
    return simulate(controller, axis, still(count), PERIOD_S, disturbance=force)


@pytest.mark.parametrize("name", [*LAWS, *WRAPPERS])
def test_parts_of_the_command_are_named_and_add_up(name: str) -> None:
    controller = make(name)
    controller.output(0.0, 0.06, 0.0, 0.0, 0.06)
    command = controller.output(0.1, 0.05, -0.03, 0.0995, 0.049)
    named = dict(zip(controller.state_names, controller.state(), strict=True))
    assert len(named) <= 8
    parts = [value for key, value in named.items() if key.endswith("_command")]
    assert sum(parts) == pytest.approx(command)


@pytest.mark.parametrize("name", [*LAWS, *WRAPPERS])
def test_the_defaults_track_the_bench_and_break_no_limit(name: str) -> None:
    reference = sine(0.1, 0.6, 750)
    run = simulate(make(name), AXIS, reference, PERIOD_S)
    assert np.abs(run.tracking_error_m(reference)[250:]).max() < 0.03
    warnings = make(name).warnings()
    assert warnings == [] or (name == "smc_sgn" and "no boundary layer" in warnings[0])


@pytest.mark.parametrize("name", [*LAWS, *WRAPPERS])
def test_defaults_scale_with_the_unit_of_the_command(name: str) -> None:
    heavy = replace(
        AXIS,
        inertia=50 * AXIS.inertia,
        viscous_friction=50 * AXIS.viscous_friction,
        coulomb_friction=50 * AXIS.coulomb_friction,
        static_friction=50 * AXIS.static_friction,
        saturation=1000.0,
    )
    reference = sine(0.1, 0.6, 300)
    light = simulate(make(name), AXIS, reference, PERIOD_S)
    scaled = simulate(make(name, heavy), heavy, reference, PERIOD_S)
    assert np.allclose(scaled.position_m, light.position_m, atol=2e-4)


@pytest.mark.parametrize("name", ["pid", "lqr", "adrc", "super_twisting"])
def test_integral_action_leaves_no_error_under_a_constant_force(name: str) -> None:
    values = {"integral_limit": 5.0} if name != "adrc" else {}
    values |= {"integral_gain": 2.0} if name == "super_twisting" else {}
    run = pushed(make(name, SMOOTH_AXIS, **values), SMOOTH_AXIS, 0.3)
    assert abs(run.position_m[-1]) < 1e-5 < np.abs(run.position_m).max()


def test_pid_integral_stays_within_its_bound() -> None:
    controller = PID(PIDConfig(ki=50.0, integral_limit=0.4), SMOOTH_AXIS, PERIOD_S)
    run = pushed(controller, SMOOTH_AXIS, 3.0)
    integral = run.states[:, controller.state_names.index("integral_command")]
    assert np.abs(integral).max() == pytest.approx(0.4)
    assert np.abs(run.position_m[-1]) > 0.01


def test_eq_10_reaches_the_surface_within_its_time() -> None:
    quick = replace(COULOMB_AXIS, delay_periods=0)
    controller = SignController(SignConfig(surface_slope=2.0, reach_rate=0.5), quick, 0.001)
    run = simulate(controller, quick, still(400), 0.001, initial_position_m=0.05)
    surface, reach_s = run.states[:, 0], run.states[0, 6]
    assert reach_s == pytest.approx(0.1 / 0.5)
    first = np.flatnonzero(np.abs(surface) < 0.002)[0]
    assert 0.001 * first <= reach_s
    assert np.abs(surface[int(reach_s / 0.001) :]).max() < 0.005


def test_eq_10_says_that_reaching_needs_a_rate() -> None:
    controller = SignController(SignConfig(reach_rate=0.0), COULOMB_AXIS, PERIOD_S)
    controller.output(0.1, 0.0, 0.0, 0.0, 0.0)
    assert controller.state()[6] == np.inf


def test_riccati_agrees_with_scipy() -> None:
    from scipy.linalg import solve_discrete_are

    a = np.array([[1.0, 0.04, 0.0], [0.0, 1.0, 0.035], [0.0, 0.0, 0.9]])
    b, weights, r = np.array([0.0, 0.001, 0.04]), np.array([30.0, 1e4, 100.0]), 2.0
    p = solve_discrete_are(a, b[:, None], np.diag(weights), np.array([[r]]))
    expected = (b @ p @ a) / (r + b @ p @ b)
    assert regulator_gains(a.tolist(), b.tolist(), weights.tolist(), r) == pytest.approx(expected)


def test_riccati_refuses_what_cannot_be_held() -> None:
    with pytest.raises(UsageError, match="does not settle"):
        regulator_gains([[1.5, 0.0], [0.0, 0.5]], [0.0, 1.0], [1.0, 1.0], 1.0)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_lqr_is_stable_with_every_delay_and_takes_stored_gains(delay: int) -> None:
    axis = replace(SMOOTH_AXIS, delay_periods=delay)
    config = LQRConfig(integral_limit=5.0)
    gains = design(config, axis, PERIOD_S)
    stored = LQR(LQRConfig(gains=gains, integral_limit=5.0), axis, PERIOD_S)
    designed = pushed(LQR(config, axis, PERIOD_S), axis, 0.2)
    assert np.array_equal(pushed(stored, axis, 0.2).command, designed.command)
    assert stored.warnings() == []
    assert abs(designed.position_m[-1]) < 1e-4


def test_lqr_gains_of_another_axis_are_told_or_refused() -> None:
    gains = design(LQRConfig(), AXIS, PERIOD_S)
    heavy = replace(AXIS, inertia=3.0)
    assert "not those" in LQR(LQRConfig(gains=gains), heavy, PERIOD_S).warnings()[0]
    with pytest.raises(UsageError, match="needs 5"):
        LQR(LQRConfig(gains=gains), replace(AXIS, delay_periods=2), PERIOD_S)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("kd", [2.0, 12.0, 20.0, 60.0])
def test_the_stability_limit_is_where_the_loop_diverges(delay: int, kd: float) -> None:
    axis = Axis(1.0, 0.5, 0.0, delay_periods=delay)
    radius = loop_radius(axis, PERIOD_S, 30.0, kd)
    run = simulate(
        make("pd", axis, kp=30.0, kd=kd), axis, still(400), PERIOD_S, initial_position_m=1e-3
    )
    grown = np.abs(run.position_m[-50:]).max() / 1e-3
    assert (grown > 1.0) == (radius > 1.0)


@pytest.mark.parametrize(
    ("name", "values", "told"),
    [
        ("pid", {"kd": 60.0}, "unstable"),
        ("pid", {"ki": 400.0}, "unstable"),
        ("pid", {"integral_limit": 0.1}, "integral_limit"),
        ("super_twisting", {"root_gain": 20.0}, "unstable"),
        ("super_twisting", {"integral_limit": 0.01}, "integral_limit"),
        ("smc_sgn", {"surface_slope": 12.0}, "surface_slope"),
        ("smc_sgn", {"gain": 0.1}, "static friction"),
        ("smc_sgn", {"dead_zone_m_s": 0.001}, "dead_zone_m_s"),
        ("adrc", {"observer_bandwidth_1_s": 7.0}, "observer"),
        ("adrc", {"bandwidth_1_s": 20.0, "observer_bandwidth_1_s": 60.0}, "bandwidth_1_s x lag"),
        ("disturbance_observer", {"gain": 0.9}, "gain"),
    ],
)
def test_each_broken_limit_is_named(name: str, values: dict[str, Any], told: str) -> None:
    assert any(told in warning for warning in make(name, **values).warnings())


def test_laws_are_odd() -> None:
    for name in LAWS:
        one, other = make(name), make(name)
        for k in range(5):
            motion = (0.1, 0.02 * k, 0.01, 0.098, 0.03 - 0.01 * k)
            assert one.output(*motion) == -other.output(*(-value for value in motion))


def test_super_twisting_and_adrc_are_smooth() -> None:
    reference = sine(0.1, 0.6, 750)
    for controller in (
        SuperTwisting(SuperTwistingConfig(), AXIS, PERIOD_S),
        ADRC(ADRCConfig(), AXIS, PERIOD_S),
    ):
        run = simulate(controller, AXIS, reference, PERIOD_S)
        assert np.diff(run.command[250:]).std() < 0.06
