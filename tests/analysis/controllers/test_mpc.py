"""Model predictive control, where its solver is installed."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from seamlog.analysis.closed_loop import Reference, simulate
from seamlog.analysis.controllers.mpc import MPC, MPCConfig
from seamlog.errors import HardwareError
from tests.analysis.axis_bench import AXIS, COULOMB_AXIS, PERIOD_S, sine, speed_noise


def test_without_its_solver_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "osqp", None)
    with pytest.raises(HardwareError, match=r"pip install 'seamlog\[mpc\]'"):
        MPC(MPCConfig(), AXIS, PERIOD_S)


def test_it_tracks_as_well_as_any() -> None:
    pytest.importorskip("osqp", reason="extra mpc is not installed")
    reference = sine(0.1, 0.6, 500)
    run = simulate(
        MPC(MPCConfig(), AXIS, PERIOD_S),
        AXIS,
        reference,
        PERIOD_S,
        velocity_noise_m_s=speed_noise(3, 500),
        encoder_step_m=1e-6,
    )
    assert np.abs(run.tracking_error_m(reference)[250:]).max() < 1e-3


def test_it_plans_within_the_saturation_and_brakes_in_time() -> None:
    pytest.importorskip("osqp", reason="extra mpc is not installed")
    tight = replace(COULOMB_AXIS, saturation=0.6)
    still = Reference(np.zeros(300), np.zeros(300), np.zeros(300))
    controller = MPC(MPCConfig(horizon_periods=30), tight, PERIOD_S)
    run = simulate(controller, tight, still, PERIOD_S, initial_position_m=0.05)
    assert np.abs(run.command).max() == pytest.approx(0.6, abs=1e-3)
    assert run.position_m.min() > -0.002
    assert abs(run.position_m[-1]) < 3e-3


def test_a_horizon_shorter_than_the_delay_is_told() -> None:
    pytest.importorskip("osqp", reason="extra mpc is not installed")
    late = replace(AXIS, delay_periods=3)
    assert "horizon" in MPC(MPCConfig(horizon_periods=5), late, PERIOD_S).warnings()[0]
