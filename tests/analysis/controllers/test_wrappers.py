"""Observer and predictor around other controllers; any estimator in the adaptive law."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from seamlog import plugins
from seamlog.analysis.closed_loop import simulate
from seamlog.analysis.controllers.adaptive import AdaptiveConfig, AdaptiveController
from seamlog.analysis.controllers.disturbance_observer import (
    DisturbanceObserver,
    DisturbanceObserverConfig,
)
from seamlog.analysis.controllers.inner import InnerController, InnerEstimator
from seamlog.analysis.controllers.pd import PD, PDConfig
from seamlog.analysis.controllers.predictor import Predictor, PredictorConfig
from seamlog.contracts import Axis
from seamlog.errors import UnknownName, UsageError
from tests.analysis.axis_bench import AXIS, COULOMB_AXIS, PERIOD_S, sine, speed_noise

INNER = InnerController(name="pd", config={"feed_forward": True})
ASYMMETRIC = replace(
    COULOMB_AXIS, coulomb_friction_negative=0.4, viscous_friction_negative=3.0, offset=0.1
)


def rms_mm(controller: Any, axis: Axis = COULOMB_AXIS, force: float = 0.0) -> float:
    reference = sine(0.1, 0.6)
    run = simulate(controller, axis, reference, PERIOD_S, disturbance=force)
    return float(1e3 * np.sqrt(np.mean(run.tracking_error_m(reference)[250:] ** 2)))


@pytest.mark.parametrize("axis", [COULOMB_AXIS, ASYMMETRIC])
@pytest.mark.parametrize("delay", [0, 1, 2])
def test_the_observer_finds_a_constant_force_exactly(axis: Axis, delay: int) -> None:
    axis = replace(axis, delay_periods=delay)
    config = DisturbanceObserverConfig(controller=INNER, gain=0.15)
    observer = DisturbanceObserver(config, axis, PERIOD_S)
    assert rms_mm(observer, axis, 0.3) < 0.3 * rms_mm(
        PD(PDConfig(feed_forward=True), axis, PERIOD_S), axis, 0.3
    )
    assert observer.state()[-1] == pytest.approx(0.3, abs=1e-6)


def test_the_observer_believes_in_nothing_larger_than_its_limit() -> None:
    config = DisturbanceObserverConfig(controller=INNER, limit=0.1)
    observer = DisturbanceObserver(config, COULOMB_AXIS, PERIOD_S)
    rms_mm(observer, COULOMB_AXIS, 0.3)
    assert observer.state()[-1] == pytest.approx(0.1)


def test_the_observer_knows_what_acted_under_saturation() -> None:
    tight = replace(COULOMB_AXIS, saturation=0.36)
    observer = DisturbanceObserver(DisturbanceObserverConfig(), tight, PERIOD_S)
    run = simulate(observer, tight, sine(0.1, 0.6), PERIOD_S)
    assert run.saturated.any()
    assert np.abs(run.states[:, -1]).max() < 1e-9


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_with_a_true_model_the_predictor_sees_what_will_be(delay: int) -> None:
    axis = replace(COULOMB_AXIS, delay_periods=delay)
    predictor = Predictor(PredictorConfig(controller=INNER), axis, PERIOD_S)
    run = simulate(predictor, axis, sine(0.1, 0.6), PERIOD_S)
    foreseen = run.states[:-delay, -1]
    assert np.allclose(foreseen, run.position_m[delay:], rtol=0, atol=1e-12)


def test_the_predictor_allows_gains_that_the_delay_forbids() -> None:
    late = replace(COULOMB_AXIS, delay_periods=3)
    stiff = {"kp": 100.0, "kd": 18.0, "feed_forward": True}
    bare = PD(PDConfig.model_validate(stiff), late, PERIOD_S)
    ahead = Predictor(
        PredictorConfig(controller=InnerController(name="pd", config=stiff)), late, PERIOD_S
    )
    assert bare.warnings() and not ahead.warnings()
    assert rms_mm(ahead, late) < 0.5 < rms_mm(bare, late)


def test_without_delay_the_predictor_says_that_it_is_idle() -> None:
    quick = replace(COULOMB_AXIS, delay_periods=0)
    idle = Predictor(PredictorConfig(controller=INNER), quick, PERIOD_S)
    assert "does nothing" in idle.warnings()[0]
    assert rms_mm(idle, quick) == rms_mm(PD(PDConfig(feed_forward=True), quick, PERIOD_S), quick)


def test_wrappers_nest_until_no_log_could_hold_their_states() -> None:
    paper = {"name": "paper", "config": {}}
    once = {"name": "predictor", "config": {"controller": paper}}
    config = DisturbanceObserverConfig.model_validate({"controller": once})
    assert len(DisturbanceObserver(config, AXIS, PERIOD_S).state_names) == 8
    deeper = {"name": "disturbance_observer", "config": {"controller": once}}
    with pytest.raises(UsageError, match="wrap fewer"):
        DisturbanceObserver(
            DisturbanceObserverConfig.model_validate({"controller": deeper}), AXIS, PERIOD_S
        )


def test_faults_of_what_is_inside_are_told() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'pid'"):
        InnerController(name="pidd")
    with pytest.raises(ValidationError, match=r"kp: .*greater than or equal to 0"):
        InnerController(name="pd", config={"kp": -1.0})
    config = DisturbanceObserverConfig(controller=InnerController(name="pd", config={"kd": 60.0}))
    assert "unstable" in DisturbanceObserver(config, AXIS, PERIOD_S).warnings()[0]


def test_a_configuration_tells_all_that_it_leaves_to_defaults() -> None:
    dumped = DisturbanceObserverConfig().model_dump(mode="json")
    assert dumped["controller"]["config"]["dead_zone_m_s"] == 0.0005
    assert DisturbanceObserverConfig.model_validate(dumped) == DisturbanceObserverConfig()


@pytest.mark.parametrize("name", sorted(plugins.available("seamlog.estimators")))
def test_any_estimator_can_tune_the_adaptive_law(name: str) -> None:
    config = AdaptiveConfig(estimator=InnerEstimator(name=name))
    controller = AdaptiveController(config, COULOMB_AXIS, PERIOD_S)
    reference = sine(0.1, 1.0, 500)
    run = simulate(
        controller, COULOMB_AXIS, reference, PERIOD_S, velocity_noise_m_s=speed_noise(2, 500)
    )
    assert np.abs(run.tracking_error_m(reference)[250:]).max() < 0.04
