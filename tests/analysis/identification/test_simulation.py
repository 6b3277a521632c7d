"""Output error and simulated instruments on a fast servo axis whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord, Drive
from seamlog.analysis.identification.identify import identify_axis, select_axis_model
from seamlog.analysis.identification.idim_iv import identify_idim_iv
from seamlog.analysis.identification.idim_ls import IdimSettings, identify_idim_ls
from seamlog.analysis.identification.output_error import identify_output_error
from seamlog.analysis.identification.servo import Servo, fit_servo, replay_error
from seamlog.analysis.identification.simulation import (
    AxisForces,
    Side,
    make_step,
    simulate_commands,
    simulate_servo,
)
from seamlog.errors import EvidenceError

PERIOD_S = 0.002
LAW = Servo(120.0, 200.0, window=2, delay_periods=0, relative_error=0.0)
SIDE = Side(200.0, 20.0, ())
TRUTH = AxisForces(90.0, -3.0, SIDE, SIDE)
VALUES = np.array([90.0, 200.0, 20.0, -3.0])


def servo_record(noise_m: float = 0.0, seconds: float = 8.0) -> AxisRecord:
    """The drive's law on the true axis; `noise_m` is added to the recorded positions."""
    time = PERIOD_S * np.arange(round(seconds / PERIOD_S))
    soft = 1 - np.exp(-((time / 0.5) ** 3))
    reference = soft * (0.1 * np.sin(1.7 * time) + 0.02 * np.sin(7.0 * time))
    stamp_ns = 2_000_000 * np.arange(len(time))
    none = np.full(len(time), np.nan)
    blank = AxisRecord(
        stamp_ns,
        stamp_ns,
        reference,
        none,
        reference,
        none,
        none,
        np.zeros(len(time)),
        np.zeros(len(time), dtype=np.bool_),
        Drive("V", 35.0, "N"),
        PERIOD_S,
    )
    if noise_m == 0.0:
        run = simulate_servo(blank, TRUTH, LAW, 0.0)
        return replace(blank, position_m=run.position_m, command=run.command)
    return noisy(blank, noise_m)


def noisy(record: AxisRecord, noise_m: float) -> AxisRecord:
    """The same loop with a drive that sees what is recorded: positions with noise."""
    step, scale = make_step(TRUTH, PERIOD_S), record.drive.scale
    noise = np.random.default_rng(1).normal(0.0, noise_m, len(record)).tolist()
    x, v = float(record.reference_m[0]), 0.0
    seen, commands = [x, x], []
    for wanted, error in zip(record.reference_m.tolist(), noise, strict=True):
        seen.append(x + error)
        speed = (seen[-1] - seen[-3]) / (2 * PERIOD_S)
        commands.append(200.0 * (120.0 * (wanted - seen[-1]) - speed))
        after = step(v, scale * commands[-1])
        x, v = x + 0.5 * PERIOD_S * (v + after), after
    return replace(record, position_m=np.array(seen[2:]), command=np.array(commands))


@pytest.fixture(scope="module")
def clean() -> AxisRecord:
    return servo_record()


def test_the_law_is_told_exactly(clean: AxisRecord) -> None:
    found = fit_servo(clean)
    assert found.position_gain_1_s == pytest.approx(120.0, rel=1e-9)
    assert found.velocity_gain == pytest.approx(200.0, rel=1e-9)
    assert (found.window, found.delay_periods) == (2, 0)
    assert replay_error(clean, found) < 1e-9


def test_the_axis_under_its_own_commands_goes_where_it_went(clean: AxisRecord) -> None:
    np.testing.assert_allclose(simulate_commands(clean, TRUTH, 0.0), clean.position_m, atol=1e-9)


def test_a_record_that_begins_in_motion_is_followed(clean: AxisRecord) -> None:
    """The stretch after a gap begins anywhere in the motion."""
    late = clean.rows(slice(1500, None))
    run = simulate_servo(late, TRUTH, LAW, 0.0)
    assert np.abs(np.diff(late.position_m[:2])).item() > 1e-5
    np.testing.assert_allclose(run.position_m, late.position_m, atol=2e-5)


def test_an_axis_at_rest_holds_until_friction_breaks(clean: AxisRecord) -> None:
    force = np.where(np.arange(len(clean)) < 2000, 16.9, 17.1)
    pushed = replace(clean, command=force / clean.drive.scale)
    travel = simulate_commands(pushed, replace(TRUTH, offset=-3.0), 0.0) - clean.position_m[0]
    assert np.all(travel[:2001] == 0.0)
    assert travel[-1] > 1e-4


@pytest.mark.parametrize("loop", ["closed", "open"])
def test_output_error_finds_the_truth(loop: str, clean: AxisRecord) -> None:
    found = identify_output_error(
        clean, "symmetric", IdimSettings(lag_periods=0.5), "closed" if loop == "closed" else "open"
    )
    np.testing.assert_allclose(found.fit.values, VALUES, rtol=2e-3, atol=0.02)
    assert found.settings["loop"] == loop
    assert found.extras["open_loop"]["position_rms_mm"] < 0.2


def test_instruments_take_away_the_bias_of_noisy_positions() -> None:
    record = servo_record(noise_m=1e-5)
    settings = IdimSettings(lag_periods=0.5)
    plain = identify_idim_ls(record, settings=settings).fit
    freed = identify_idim_iv(record, settings=settings).fit
    assert abs(plain.value("inertia") / 90 - 1) > 0.01
    assert abs(freed.value("inertia") / 90 - 1) < 0.005
    assert np.all(np.abs(freed.values - VALUES) < 4 * freed.sd)


def test_the_lag_is_chosen_by_cross_validation(clean: AxisRecord) -> None:
    chosen = select_axis_model(clean).chosen
    assert chosen.friction == "symmetric"
    assert chosen.lag_periods in (0.25, 0.5, 0.75)


def test_output_error_without_reference_runs_open_and_says_why(clean: AxisRecord) -> None:
    bare = replace(clean, reference_m=np.full(len(clean), np.nan))
    found, why = identify_axis(bare, "output-error", lag_periods=0.5)
    assert why == "asked for" and found.settings["loop"] == "open"
    assert any("no /table/reference" in note for note in found.notes)
    with pytest.raises(EvidenceError, match="no /table/reference"):
        identify_idim_iv(bare)
