from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from seamlog import plugins
from seamlog.analysis.closed_loop import Reference, simulate
from seamlog.analysis.controllers.adaptive import AdaptiveConfig, AdaptiveController
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.controllers.pd import PD, PDConfig
from seamlog.analysis.estimators.gated_rls import GatedRLS, GatedRLSConfig
from seamlog.contracts import Axis

from .axis_bench import AXIS, ENCODER_STEP_M, PERIOD_S, sine, speed_noise

FREE_AXIS = Axis(inertia=2.0, viscous_friction=0.0, coulomb_friction=0.0, delay_periods=0)
NOMINAL = replace(
    AXIS,
    inertia=1.02 * AXIS.inertia,
    viscous_friction=0.98 * AXIS.viscous_friction,
    coulomb_friction=0.97 * AXIS.coulomb_friction,
)


def still(count: int) -> Reference:
    return Reference(np.zeros(count), np.zeros(count), np.zeros(count))


@pytest.mark.parametrize("form", ["right", "as_printed"])
@pytest.mark.parametrize("reach_rate", [0.0, 0.05])
def test_constant_force_inside_the_layer_leaves_the_predicted_error(
    form: str, reach_rate: float
) -> None:
    slope, gain, layer, force = 3.0, 0.8, 0.3, 0.2
    config = PaperConfig.model_validate(
        {
            "surface_slope": slope,
            "gain": gain,
            "boundary_layer": layer,
            "reach_rate": reach_rate,
            "form": form,
        }
    )
    controller = PaperController(config, FREE_AXIS, 0.01)
    run = simulate(controller, FREE_AXIS, still(3000), 0.01, disturbance=force)
    a = FREE_AXIS.inertia
    expected_m = layer * force / (slope * (gain + a * reach_rate + a * slope * layer))
    assert run.tracking_error_m(still(3000))[-1] == pytest.approx(expected_m, rel=1e-6)


def overshoot(form: str) -> float:
    config = PaperConfig.model_validate({"surface_slope": 4.0, "gain": 0.0, "form": form})
    controller = PaperController(config, FREE_AXIS, 0.001)
    run = simulate(
        controller,
        FREE_AXIS,
        still(4000),
        0.001,
        initial_position_m=1.0,
        initial_velocity_m_s=0.0,
    )
    return -float(run.position_m.min())


def test_printed_coefficient_halves_the_damping() -> None:
    assert overshoot("right") < 0.005
    assert overshoot("as_printed") == pytest.approx(0.163, abs=0.01)


def tracking_error_mm(controller: PaperController | PD | AdaptiveController) -> np.ndarray:
    reference = sine(0.1, 0.6)
    run = simulate(
        controller,
        AXIS,
        reference,
        PERIOD_S,
        velocity_noise_m_s=speed_noise(3),
        encoder_step_m=ENCODER_STEP_M,
    )
    return np.asarray(1e3 * run.tracking_error_m(reference)[250:])


def test_the_papers_law_beats_pd_on_the_tracking_bench() -> None:
    law = PaperConfig(surface_slope=7.1, gain=0.213, boundary_layer=0.0125)
    paper = tracking_error_mm(PaperController(law, NOMINAL, PERIOD_S))
    pd = tracking_error_mm(PD(PDConfig(kp=137.0, kd=14.0), NOMINAL, PERIOD_S))
    assert np.abs(paper).max() < 1.3 and paper.std() < 0.7
    assert 2.2 < np.abs(pd).max() < 3.2


def test_feed_forward_helps_pd() -> None:
    plain = tracking_error_mm(PD(PDConfig(), NOMINAL, PERIOD_S))
    helped = tracking_error_mm(PD(PDConfig(feed_forward=True), NOMINAL, PERIOD_S))
    assert helped.std() < 0.1 * plain.std()


def test_a_tuning_inside_all_limits_has_no_warnings() -> None:
    assert PaperController(PaperConfig(), AXIS, PERIOD_S).warnings() == []
    assert PD(PDConfig(), AXIS, PERIOD_S).warnings() == []


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"surface_slope": 12.0}, "surface_slope"),
        ({"boundary_layer": 0.01}, "limit cycle"),
        ({"gain": 0.1}, "static friction"),
        ({"dead_zone_m_s": 0.001}, "dead_zone_m_s"),
    ],
)
def test_each_broken_limit_is_named(values: dict[str, float], named: str) -> None:
    warnings = PaperController(PaperConfig.model_validate(values), AXIS, PERIOD_S).warnings()
    assert any(named in warning for warning in warnings)


def test_dead_zone_on_the_reference_speed_has_no_limit() -> None:
    config = PaperConfig(dead_zone_m_s=1e-4, friction_speed="reference")
    assert PaperController(config, AXIS, PERIOD_S).warnings() == []


def test_pd_with_too_much_damping_is_warned_of_and_unstable() -> None:
    wild = PD(PDConfig(kd=40.0), AXIS, PERIOD_S)
    assert "kd" in wild.warnings()[0]
    assert np.abs(tracking_error_mm(wild)).max() > 5.0


def test_states_are_named_one_by_one() -> None:
    for controller in (
        PaperController(PaperConfig(), AXIS, PERIOD_S),
        PD(PDConfig(), AXIS, PERIOD_S),
        AdaptiveController(AdaptiveConfig(), AXIS, PERIOD_S),
    ):
        command = controller.output(0.1, 0.02, 0.0, 0.09, 0.01)
        named = dict(zip(controller.state_names, controller.state(), strict=True))
        assert len(named) <= 8
        assert named["tracking_error_m"] == pytest.approx(0.01)
        parts = [value for name, value in named.items() if name.endswith("_command")]
        assert sum(parts) == pytest.approx(command)


def test_adaptive_law_finds_the_axis_and_then_tracks_as_if_it_had_known_it() -> None:
    wrong = replace(AXIS, inertia=1.5, viscous_friction=1.2, coulomb_friction=0.4)
    reference, law = sine(0.1, 1.0), PaperConfig(gain=AXIS.static_friction)

    def late_error_mm(controller: AdaptiveController | PaperController) -> float:
        run = simulate(controller, AXIS, reference, PERIOD_S, velocity_noise_m_s=speed_noise(5))
        return float(1e3 * run.tracking_error_m(reference)[750:].std())

    adaptive = AdaptiveController(AdaptiveConfig(law=law), wrong, PERIOD_S)
    adapted_mm = late_error_mm(adaptive)
    assert adaptive.estimator.parameters() == pytest.approx((1.0, 2.14, 0.214), rel=0.01)
    knowing_mm = late_error_mm(PaperController(law, AXIS, PERIOD_S))
    fixed_mm = late_error_mm(PaperController(law, wrong, PERIOD_S))
    assert adapted_mm == pytest.approx(knowing_mm, rel=0.05)
    assert adapted_mm < 0.8 * fixed_mm


def test_adaptive_estimator_sees_the_command_that_acted() -> None:
    tight = replace(AXIS, saturation=0.5)
    controller = AdaptiveController(AdaptiveConfig(), tight, PERIOD_S)
    run = simulate(controller, tight, sine(0.1, 1.0), PERIOD_S, velocity_noise_m_s=speed_noise(5))
    assert run.saturated.any()
    alone = GatedRLS(GatedRLSConfig(), PERIOD_S)
    before = [0.0, *run.applied_command[:-1]]
    for seen in zip(run.measured_position_m, run.measured_velocity_m_s, before, strict=True):
        alone.update(*seen)
    assert controller.estimator.parameters() == alone.parameters()


def test_controllers_are_found_by_name() -> None:
    for name in ("pd", "paper", "adaptive"):
        factory = plugins.load("seamlog.controllers", name)
        assert factory(factory.Config(), AXIS, PERIOD_S).output(0.1, 0.0, 0.0, 0.0, 0.0) > 0.0


def test_nonsense_tunings_are_refused() -> None:
    with pytest.raises(ValidationError):
        PaperConfig.model_validate({"surface_slope": -1.0, "lambda": 3.0})
