"""What the record tells of axis, ripple and drift, and loops simulated side by side."""

from dataclasses import replace

import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord
from seamlog.analysis.closed_loop import simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.controllers.pd import PD, PDConfig
from seamlog.analysis.replay.batch import Start, World, simulate_worlds
from seamlog.analysis.replay.counterfactual import make_scene, predict
from seamlog.analysis.replay.figures import rms_mm, unexplained_miss
from seamlog.analysis.replay.model import RippleForce, identify_model
from seamlog.analysis.replay.tables import whole_band_m
from seamlog.analysis.stribeck_plant import Ripple, StribeckPlant
from seamlog.contracts import Axis

from .test_replay import LAW, PERIOD_S, TRUTH, MakeLoop, bench_reference

STRIBECK = replace(TRUTH, static_friction=0.257, stribeck_speed_m_s=0.002, offset=0.01)


def disturbed_record(loop: MakeLoop, encoder_step_m: float = 1e-6) -> AxisRecord:
    """Stribeck friction, ripple and drift under the paper's law."""
    reference = bench_reference()
    count = len(reference.position_m)
    run = simulate(
        PaperController(PaperConfig(surface_slope=4.0, boundary_layer=0.02), TRUTH, PERIOD_S),
        STRIBECK,
        reference,
        PERIOD_S,
        plant=StribeckPlant(STRIBECK, PERIOD_S, 40, Ripple(0.03, 0.01)),
        velocity_noise_m_s=np.random.default_rng(7).normal(0, 5e-4, count),
        disturbance=0.03 * np.sin(2 * np.pi * PERIOD_S * np.arange(count) / 37),
        encoder_step_m=encoder_step_m,
    )
    return replace(
        loop(reference=reference),
        position_m=run.measured_position_m,
        velocity_m_s=run.measured_velocity_m_s,
        command=run.command,
        saturated=run.saturated,
    )


def test_the_force_balance_tells_axis_ripple_and_drift_apart(loop: MakeLoop) -> None:
    record = disturbed_record(loop)
    model = identify_model(record, None)
    axis = model.axis
    found = [axis.inertia, axis.viscous_friction, axis.coulomb_friction]
    np.testing.assert_allclose(found, [1.0, 2.14, 0.214], rtol=0.01)
    assert axis.static_friction == pytest.approx(0.257, rel=0.05)
    assert axis.stribeck_speed_m_s == pytest.approx(0.002, rel=0.2)
    assert model.ripple.sine == pytest.approx(0.03, rel=0.02)
    assert model.ripple.pitch_m == pytest.approx(0.01, rel=1e-3)
    slow = make_scene(record, model).residual(axis, model.ripple).slow + axis.offset
    drift = 0.01 + 0.03 * np.sin(2 * np.pi * PERIOD_S * np.arange(len(record)) / 37)
    assert np.std(slow - drift) < 0.003


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_the_motion_tells_the_delay(loop: MakeLoop, delay: int) -> None:
    record = loop(truth=replace(TRUTH, delay_periods=delay))
    model = identify_model(record, None)
    assert model.axis.delay_periods == delay
    assert model.delay_from == "the motion itself"
    assert model.axis.inertia == pytest.approx(1.0, rel=0.01)


def test_coarse_positions_leave_it_to_the_gated_identification(loop: MakeLoop) -> None:
    model = identify_model(disturbed_record(loop, encoder_step_m=5e-4), None)
    assert model.windows is None
    assert model.axis.coulomb_friction == pytest.approx(0.214, rel=0.1)


def test_a_plain_axis_gets_no_ripple(loop: MakeLoop) -> None:
    model = identify_model(loop(), None)
    assert model.ripple == RippleForce()
    assert model.axis.static_friction < 1.1 * model.axis.coulomb_friction


@pytest.mark.parametrize("axis", [TRUTH, STRIBECK, replace(STRIBECK, stribeck_power=2.0)])
def test_loops_side_by_side_are_loops(axis: Axis) -> None:
    reference = bench_reference(20.0)
    count = len(reference.position_m)
    noise = np.random.default_rng(3).normal(0, 5e-4, (2, count))
    load = np.stack([np.zeros(count), 0.02 * np.ones(count)])
    ripples = (RippleForce(0.03, 0.0, 0.01), RippleForce())
    runs = simulate_worlds(
        [PD(PDConfig(), TRUTH, PERIOD_S) for _ in range(2)],
        [World(axis, ripples[i], load[i], noise[i]) for i in range(2)],
        reference,
        PERIOD_S,
        Start(0.0, 0.05, 1e-6),
        watched=[1],
    )
    for place, wave in enumerate((Ripple(0.03, 0.01), None)):
        alone = simulate(
            PD(PDConfig(), TRUTH, PERIOD_S),
            axis,
            reference,
            PERIOD_S,
            plant=StribeckPlant(axis, PERIOD_S, 100, wave),
            velocity_noise_m_s=noise[place],
            disturbance=load[place],
            encoder_step_m=1e-6,
            initial_position_m=0.0,
            initial_velocity_m_s=0.05,
        )
        np.testing.assert_allclose(runs.position_m[place], alone.position_m, atol=3e-4)
        if place == 1:
            np.testing.assert_allclose(runs.watched[1].command, alone.command, atol=0.05)


def test_the_band_contains_what_the_model_misses_of_the_record(loop: MakeLoop) -> None:
    record = disturbed_record(loop)
    scene = make_scene(record, identify_model(record, None))
    own = predict(lambda: PaperController(LAW, TRUTH, PERIOD_S), scene, 6, 0)
    other = predict(lambda: PD(PDConfig(), TRUTH, PERIOD_S), scene, 6, 0)
    narrow_low_m, narrow_high_m = other.band_m()
    low_m, high_m = whole_band_m(other, record, own)
    assert (low_m <= narrow_low_m + 1e-15).all()
    assert (high_m >= narrow_high_m - 1e-15).all()
    wrong = replace(own, error_m=own.error_m + 0.004)
    far_low_m, far_high_m = whole_band_m(other, record, wrong)
    scale = rms_mm(other.error_m) / rms_mm(record.error_m)
    assert np.mean(far_high_m - far_low_m) > 2 * 0.004 * scale * 0.9


@pytest.mark.parametrize(
    ("measured", "predicted", "miss"),
    [(1.0, [1.0, 1.0, 1.0], 0.0), (1.0, [1.5, 1.5, 1.5], 0.5), (1.0, [0.5, 1.5, 2.5], 0.0)],
)
def test_only_what_the_spread_does_not_explain_is_missed(
    measured: float, predicted: list[float], miss: float
) -> None:
    assert unexplained_miss(measured, np.array(predicted)) == pytest.approx(miss)
