import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from seamlog import plugins
from seamlog.analysis.closed_loop import ClosedLoop, simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.estimators.gain import largest_eigenvalue
from seamlog.analysis.estimators.gated_rls import GatedRLS, GatedRLSConfig
from seamlog.analysis.estimators.paper import PaperEstimator, PaperEstimatorConfig
from seamlog.contracts import Axis, Estimator

from .axis_bench import AXIS, COULOMB_AXIS, ENCODER_STEP_M, PERIOD_S, sine, speed_noise

TRUTH = np.array([AXIS.inertia, AXIS.viscous_friction, AXIS.coulomb_friction])


def identification_run(axis: Axis, noise: np.ndarray | float, step_m: float) -> ClosedLoop:
    law = PaperConfig(surface_slope=4.0, gain=AXIS.static_friction, boundary_layer=0.02)
    controller = PaperController(law, axis, PERIOD_S)
    return simulate(
        controller,
        axis,
        sine(0.1, 1.0),
        PERIOD_S,
        velocity_noise_m_s=noise,
        encoder_step_m=step_m,
    )


def estimates(estimator: Estimator, run: ClosedLoop) -> np.ndarray:
    """Parameters after each sample, shape (n, 3)."""
    before = [0.0, *run.applied_command[:-1].tolist()]
    rows = []
    motion = run.measured_position_m.tolist(), run.measured_velocity_m_s.tolist()
    for seen in zip(*motion, before, strict=True):
        estimator.update(*seen)
        rows.append(estimator.parameters())
    return np.array(rows)


@pytest.fixture(scope="module")
def noisy_run() -> ClosedLoop:
    return identification_run(AXIS, speed_noise(0), ENCODER_STEP_M)


def test_gated_estimator_is_exact_on_the_exact_plant() -> None:
    run = identification_run(COULOMB_AXIS, 0.0, 0.0)
    found = estimates(GatedRLS(GatedRLSConfig(), PERIOD_S), run)[-1]
    assert found == pytest.approx(TRUTH, rel=1e-5)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_gated_estimator_on_the_axis_bench(seed: int) -> None:
    run = identification_run(AXIS, speed_noise(seed), ENCODER_STEP_M)
    error = np.abs(estimates(GatedRLS(GatedRLSConfig(), PERIOD_S), run) / TRUTH - 1)
    assert error[round(5.2 / PERIOD_S) :].max() < 0.05
    assert error[-1].max() < 0.004


@pytest.mark.parametrize("gain", [1e-3, 1.0, 1e3, 1e6, 1e9])
def test_gated_estimator_never_diverges(gain: float, noisy_run: ClosedLoop) -> None:
    config = GatedRLSConfig(initial_gain=gain, gain_bound=10 * gain)
    found = estimates(GatedRLS(config, PERIOD_S), noisy_run)
    assert np.isfinite(found).all()
    settled = found[round(5.0 / PERIOD_S) :]
    assert np.abs(settled / TRUTH).max() < 3.0


def test_gated_estimator_knows_its_variance(noisy_run: ClosedLoop) -> None:
    estimator = GatedRLS(GatedRLSConfig(forgetting_rate=0.0), PERIOD_S)
    assert all(math.isnan(value) for value in estimator.variances())
    estimates(estimator, noisy_run)
    relative = np.sqrt(estimator.variances()) / TRUTH
    assert np.all((relative > 1e-4) & (relative < 3e-3))


def test_rows_near_rest_teach_nothing() -> None:
    estimator = GatedRLS(GatedRLSConfig(initial_inertia=7.0), PERIOD_S)
    for k in range(50):
        assert math.isnan(estimator.update(1e-4 * k, 0.004, 3.0))
    assert estimator.parameters() == (7.0, 0.0, 0.0)


def test_prediction_error_is_in_command_units(noisy_run: ClosedLoop) -> None:
    estimator = GatedRLS(
        GatedRLSConfig(
            initial_inertia=1.0,
            initial_viscous_friction=2.14,
            initial_coulomb_friction=0.214,
            initial_gain=1e-12,
        ),
        PERIOD_S,
    )
    before = [0.0, *(noisy_run.applied_command[:-1] - 0.5)]
    errors = [
        estimator.update(*seen)
        for seen in zip(
            noisy_run.measured_position_m, noisy_run.measured_velocity_m_s, before, strict=True
        )
    ]
    assert np.nanmedian(errors) == pytest.approx(0.5, abs=0.01)


def test_forgetting_follows_a_change_that_no_forgetting_averages(noisy_run: ClosedLoop) -> None:
    heavy = Axis(2.0, 2.14, 0.214, static_friction=0.257, stribeck_speed_m_s=0.002)
    later = identification_run(heavy, speed_noise(9), ENCODER_STEP_M)
    inertia = []
    for rate in (0.0, 0.2):
        estimator = GatedRLS(GatedRLSConfig(forgetting_rate=rate), PERIOD_S)
        estimates(estimator, noisy_run)
        inertia.append(estimates(estimator, later)[-1][0])
    assert inertia[0] < 1.8
    assert inertia[1] == pytest.approx(2.0, rel=0.01)


def test_printed_regressor_shifts_viscous_friction_by_the_predicted_amount() -> None:
    """With the same data, b_hat(as printed) = b_hat + (1 - lambda_f) a_hat."""
    a, b, c = 1.3, 2.0, 0.4
    pole, period = 0.97, PERIOD_S
    cutoff = (1.0 - pole) / period
    time_s = period * np.arange(30_000)
    velocity = 0.3 * np.sin(time_s) + 0.2 * np.sin(2.3 * time_s + 1.0)
    sign = np.sign(velocity)
    filtered_v, filtered_s = velocity[0] / cutoff, 0.0
    wanted_before, commands = 0.0, [0.0]
    for v, s in zip(velocity[1:], sign[1:], strict=True):
        filtered_v = pole * filtered_v + period * v
        filtered_s = pole * filtered_s + period * s
        wanted = a * (v - cutoff * filtered_v) + b * filtered_v + c * filtered_s
        commands.append((wanted - pole * wanted_before) / period)
        wanted_before = wanted
    found = []
    for form in ("right", "as_printed"):
        config = PaperEstimatorConfig.model_validate(
            {
                "form": form,
                "speed_unit": "mm/s",
                "dead_zone_m_s": 1e-4,
                "initial_gain": 4.0,
                "gain_bound": 100.0,
                "forgetting_rate": 0.05,
            }
        )
        estimator = PaperEstimator(config, period)
        for v, u in zip(velocity, commands, strict=True):
            estimator.update(0.0, v, u)
        found.append(estimator.parameters())
    right, printed = found
    assert right == pytest.approx((a, b, c), rel=1e-3)
    assert printed == pytest.approx((a, b + (1.0 - cutoff) * a, c), rel=1e-3)


def test_paper_estimator_stays_biased_on_the_bench_where_the_default_does_not(
    noisy_run: ClosedLoop,
) -> None:
    found = estimates(PaperEstimator(PaperEstimatorConfig(), PERIOD_S), noisy_run)[-1]
    assert np.isfinite(found).all()
    assert np.abs(found / TRUTH - 1).max() > 0.1


def test_explicit_euler_diverges_where_the_inverse_form_does_not(noisy_run: ClosedLoop) -> None:
    wild = PaperEstimatorConfig(initial_gain=1e4, gain_bound=1e5)
    found = estimates(PaperEstimator(wild, PERIOD_S), noisy_run)
    assert not np.all(np.abs(found) < 1e3)


def test_as_printed_asks_for_the_unit_of_speed() -> None:
    with pytest.raises(ValidationError, match="speed_unit"):
        PaperEstimatorConfig(form="as_printed")


def test_diagonal_gain_is_another_estimator(noisy_run: ClosedLoop) -> None:
    full = estimates(PaperEstimator(PaperEstimatorConfig(), PERIOD_S), noisy_run)[-1]
    diagonal = PaperEstimatorConfig(gain_form="diag")
    assert not np.allclose(full, estimates(PaperEstimator(diagonal, PERIOD_S), noisy_run)[-1])


@given(arrays(np.float64, (3, 3), elements=st.floats(-100.0, 100.0)))
def test_largest_eigenvalue_is_numpys(root: np.ndarray) -> None:
    matrix = root @ root.T
    rows, columns = np.triu_indices(3)
    upper = tuple(float(value) for value in matrix[rows, columns])
    found = largest_eigenvalue(upper)  # type: ignore[arg-type]
    expected = float(np.linalg.eigvalsh(matrix)[-1])
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_estimators_are_found_by_name() -> None:
    for name in ("gated_rls", "paper"):
        factory = plugins.load("seamlog.estimators", name)
        assert factory(factory.Config(), PERIOD_S).parameters() == (0.0, 0.0, 0.0)
