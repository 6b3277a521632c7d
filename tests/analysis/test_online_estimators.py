"""The other online estimators on the axis bench, and what all of them have in common."""

import numpy as np
import pytest

from seamlog import plugins
from seamlog.analysis.closed_loop import ClosedLoop
from seamlog.contracts import Estimator

from .axis_bench import AXIS, COULOMB_AXIS, ENCODER_STEP_M, PERIOD_S, speed_noise
from .test_estimators import TRUTH, estimates, identification_run

EXACT = ("gated_rls", "kalman", "ekf", "ukf")
ALL = (*EXACT, "rls")


def make(name: str, **tuning: float) -> Estimator:
    factory = plugins.load("seamlog.estimators", name)
    estimator: Estimator = factory(factory.Config(**tuning), PERIOD_S)
    return estimator


@pytest.fixture(scope="module")
def runs() -> list[ClosedLoop]:
    return [identification_run(AXIS, speed_noise(seed), ENCODER_STEP_M) for seed in range(5)]


@pytest.mark.parametrize("name", EXACT)
def test_bench_within_1_percent_and_5_percent_within_6_s(name: str, runs: list[ClosedLoop]) -> None:
    for run in runs:
        error = np.abs(estimates(make(name), run) / TRUTH - 1)
        assert error[-1].max() < 0.01
        assert error[round(6.0 / PERIOD_S) :].max() < 0.05


@pytest.mark.parametrize("name", EXACT)
def test_truth_lies_within_the_stated_deviation(name: str, runs: list[ClosedLoop]) -> None:
    distances = []
    for run in runs:
        estimator = make(name)
        estimates(estimator, run)
        distances.append((estimator.parameters() - TRUTH) / np.sqrt(estimator.variances()))
    assert np.abs(distances).max() < 3.0
    assert np.sqrt(np.mean(np.square(distances))) > 0.3


@pytest.mark.parametrize("gain", [1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("name", ["rls", "kalman"])
def test_no_initial_gain_diverges(name: str, gain: float, runs: list[ClosedLoop]) -> None:
    found = estimates(make(name, initial_gain=gain), runs[0])
    assert np.isfinite(found).all()
    assert np.abs(found[round(5.0 / PERIOD_S) :] / TRUTH).max() < 3.0


@pytest.mark.parametrize("spread", [1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_no_initial_spread_diverges(name: str, spread: float, runs: list[ClosedLoop]) -> None:
    found = estimates(make(name, initial_acceleration_per_command=spread), runs[0])
    assert np.isfinite(found).all()


@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_nonlinear_filters_need_no_scale(name: str) -> None:
    run = identification_run(COULOMB_AXIS, speed_noise(3), ENCODER_STEP_M)
    estimator = make(name)
    before = [0.0, *(42.0 * run.applied_command[:-1])]
    for seen in zip(run.measured_position_m, run.measured_velocity_m_s, before, strict=True):
        estimator.update(*seen)
    assert estimator.parameters() == pytest.approx(42.0 * TRUTH, rel=0.01)


@pytest.mark.parametrize("name", ALL)
def test_a_missing_sample_is_left_out(name: str, runs: list[ClosedLoop]) -> None:
    run, estimator = runs[0], make(name)
    before = [0.0, *run.applied_command[:-1]]
    rows = zip(run.measured_position_m, run.measured_velocity_m_s, before, strict=True)
    for k, (position, velocity, command) in enumerate(rows):
        if k % 97 == 5:
            position = velocity = np.nan
        if k % 97 == 50:
            command = np.nan
        estimator.update(position, velocity, command)
    reach = 0.3 if name == "rls" else 0.02
    assert estimator.parameters() == pytest.approx(TRUTH, rel=reach)


def test_plain_rls_is_the_biased_baseline(runs: list[ClosedLoop]) -> None:
    found = estimates(make("rls"), runs[0])[-1] / TRUTH
    assert found[0] < 0.99 and found[1] > 1.05


def test_kalman_follows_a_change_of_the_load() -> None:
    light = identification_run(AXIS, speed_noise(1), ENCODER_STEP_M)
    heavy_axis = type(AXIS)(2.0, 2.14, 0.214, saturation=20.0)
    heavy = identification_run(heavy_axis, speed_noise(2), ENCODER_STEP_M)
    inertia = []
    for drift in (0.0, 0.02):
        estimator = make("kalman", drift_share_1_sqrt_s=drift)
        estimates(estimator, light)
        inertia.append(estimates(estimator, heavy)[-1][0])
    assert inertia[0] < 1.8
    assert inertia[1] == pytest.approx(2.0, rel=0.03)
