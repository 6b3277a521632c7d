"""Velocity estimators on motion whose truth is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seamlog.analysis.velocity.difference import backward_difference, central_difference
from seamlog.analysis.velocity.kalman import (
    MotionModel,
    encoder_noise_m,
    kalman_states,
    kalman_velocity,
    likeliest_model,
    smoothed_velocity,
)
from seamlog.analysis.velocity.observer import ExtendedStateObserver, observer_velocity
from seamlog.analysis.velocity.savitzky_golay import savitzky_golay_causal, savitzky_golay_centred

PERIOD_S = 0.04
TIME_S = PERIOD_S * np.arange(1500)
POSITION_M = 0.1 * np.sin(0.6 * TIME_S) + 0.01 * np.sin(3 * TIME_S + 0.4)
VELOCITY_M_S = 0.06 * np.cos(0.6 * TIME_S) + 0.03 * np.cos(3 * TIME_S + 0.4)


def rms_mm_s(found: np.ndarray) -> float:
    return 1e3 * float(np.sqrt(np.mean((found - VELOCITY_M_S)[100:-100] ** 2)))


def rounded(step_m: float) -> np.ndarray:
    return np.asarray(np.round(POSITION_M / step_m) * step_m)


@pytest.mark.parametrize(
    ("step_m", "limits"),
    [
        (1e-6, (1.5, 0.06, 0.5, 0.01, 0.15, 0.01, 0.35)),
        (1e-5, (1.5, 0.10, 0.6, 0.06, 0.30, 0.07, 0.45)),
        (1e-4, (2.0, 0.65, 1.2, 0.50, 1.10, 0.25, 1.50)),
    ],
)
def test_rms_against_the_truth_for_each_encoder(step_m: float, limits: tuple[float, ...]) -> None:
    seen = rounded(step_m)
    model = likeliest_model(seen, PERIOD_S, encoder_noise_m(seen))
    found = (
        backward_difference(seen, PERIOD_S),
        central_difference(seen, PERIOD_S),
        savitzky_golay_causal(seen, PERIOD_S),
        savitzky_golay_centred(seen, PERIOD_S),
        kalman_velocity(seen, model),
        smoothed_velocity(seen, model),
        observer_velocity(seen, PERIOD_S),
    )
    errors = [rms_mm_s(velocity) for velocity in found]
    assert all(error < limit for error, limit in zip(errors, limits, strict=True)), errors
    assert errors[4] < min(errors[0], errors[2], errors[6]), "the Kalman filter leads the causal"
    assert errors[5] < errors[4]


@settings(max_examples=25, deadline=None)
@given(start=st.floats(-1, 1), speed=st.floats(-1, 1), acceleration=st.floats(-1, 1))
def test_uniform_acceleration_is_followed_exactly(
    start: float, speed: float, acceleration: float
) -> None:
    time = PERIOD_S * np.arange(400)
    position = start + speed * time + 0.5 * acceleration * time**2
    truth = speed + acceleration * time
    model = MotionModel(1.0, 1e-5, PERIOD_S)
    for found in (
        savitzky_golay_causal(position, PERIOD_S),
        savitzky_golay_centred(position, PERIOD_S),
        kalman_velocity(position, model),
        smoothed_velocity(position, model),
        observer_velocity(position, PERIOD_S),
    ):
        np.testing.assert_allclose(found[200:-10], truth[200:-10], atol=1e-6)


def test_causal_ones_do_not_look_ahead() -> None:
    changed = POSITION_M.copy()
    changed[700:] += 0.01
    model = MotionModel(1.0, 1e-5, PERIOD_S)

    def causal(position: np.ndarray) -> list[np.ndarray]:
        return [
            backward_difference(position, PERIOD_S),
            savitzky_golay_causal(position, PERIOD_S),
            kalman_velocity(position, model),
            observer_velocity(position, PERIOD_S),
        ]

    for before, after in zip(causal(POSITION_M), causal(changed), strict=True):
        np.testing.assert_array_equal(before[:700], after[:700])
        assert not np.array_equal(before[700:], after[700:])


def test_a_missing_position_is_bridged() -> None:
    holed = rounded(1e-6)
    holed[500] = np.nan
    found = smoothed_velocity(holed, MotionModel(1e-2, 3e-7, PERIOD_S))
    assert np.isfinite(found).all()
    assert np.abs(found - VELOCITY_M_S)[490:515].max() < 1e-3


def test_the_innovations_are_as_large_as_the_filter_says() -> None:
    random = np.random.default_rng(5)
    jerk = random.normal(0.0, np.sqrt(0.3 / PERIOD_S), 8000)
    acceleration = np.cumsum(jerk) * PERIOD_S
    speed = np.cumsum(acceleration) * PERIOD_S
    position = np.cumsum(speed) * PERIOD_S + random.normal(0.0, 1e-4, 8000)
    model = likeliest_model(position, PERIOD_S, 1e-4)
    assert model.jerk_density == pytest.approx(0.3, rel=0.35)
    innovations = kalman_states(position, model)[1][100:]
    assert np.var(innovations) == pytest.approx(model.innovation_variance, rel=0.1)


def test_the_encoder_step_is_seen_in_the_positions() -> None:
    assert encoder_noise_m(rounded(1e-5)) == pytest.approx(1e-5 / np.sqrt(12), rel=1e-6)


def test_the_observer_keeps_its_state_between_samples() -> None:
    observer = ExtendedStateObserver(40.0, PERIOD_S, POSITION_M[0])
    found = [observer.update(value)[1] for value in POSITION_M]
    np.testing.assert_array_equal(found, observer_velocity(POSITION_M, PERIOD_S))
