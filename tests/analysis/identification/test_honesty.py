"""Stated deviations hold on an axis with ripple and Stribeck friction; bad records say so."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord
from seamlog.analysis.closed_loop import simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.identification.gated import identify_gated
from seamlog.analysis.identification.identify import identify_axis, select_axis_model
from seamlog.analysis.identification.residuals import analyse_residual
from seamlog.analysis.identification.servo import fit_servo
from seamlog.analysis.stribeck_plant import StribeckPlant
from seamlog.analysis.virtual_cell import rig
from seamlog.errors import EvidenceError
from tests.analysis.conftest import PERIOD_S, record_loop, sine_reference

MakeLoop = Callable[..., AxisRecord]
SEEDS = range(6)
TRUTH = np.array(
    [rig.TRUE_AXIS.inertia, rig.TRUE_AXIS.viscous_friction, rig.TRUE_AXIS.coulomb_friction]
)


def cell_record(seed: int, ripple: float = 1.0) -> AxisRecord:
    """The table of the virtual cell for 60 s, in sub-steps so fine that they do not matter."""
    reference = sine_reference(60.0)
    count = len(reference.position_m)
    screw = replace(rig.RIPPLE, amplitude=ripple * rig.RIPPLE.amplitude)
    run = simulate(
        PaperController(PaperConfig(surface_slope=4.0), rig.NOMINAL_AXIS, PERIOD_S),
        rig.TRUE_AXIS,
        reference,
        PERIOD_S,
        plant=StribeckPlant(rig.TRUE_AXIS, PERIOD_S, substeps=200, ripple=screw),
        velocity_noise_m_s=np.random.default_rng(seed).normal(0, rig.SPEED_NOISE_M_S, count),
        encoder_step_m=rig.ENCODER_STEP_M,
    )
    return replace(
        record_loop(reference=reference),
        position_m=run.measured_position_m,
        velocity_m_s=run.measured_velocity_m_s,
        command=run.command,
        saturated=run.saturated,
    )


@pytest.fixture(scope="module")
def records() -> list[AxisRecord]:
    return [cell_record(seed) for seed in SEEDS]


def distances(records: list[AxisRecord]) -> np.ndarray:
    """(value - truth) / deviation, shape (records, 3)."""
    fits = [identify_gated(record).fit for record in records]
    return np.array([(fit.values[:3] - TRUTH) / fit.sd[:3] for fit in fits])


def test_truth_lies_within_two_deviations(records: list[AxisRecord]) -> None:
    away = distances(records)
    assert np.mean(np.abs(away) < 2) >= 0.9
    assert np.abs(away).max() < 3
    assert np.sqrt(np.mean(away**2)) > 0.3, "deviations are not simply large"


def test_the_inertia_is_free_of_bias(records: list[AxisRecord]) -> None:
    inertia = [identify_gated(record).fit.value("inertia") for record in records]
    assert np.mean(inertia) == pytest.approx(rig.TRUE_AXIS.inertia, rel=1e-3)


def test_ripple_is_found_where_it_is(records: list[AxisRecord]) -> None:
    pitches = [identify_gated(record).extras.get("ripple", {}).get("pitch_m") for record in records]
    near = [pitch for pitch in pitches if pitch and abs(pitch - rig.RIPPLE.pitch_m) < 2.5e-3]
    assert len(near) >= 3
    strong = identify_gated(cell_record(9, ripple=4.0)).extras["ripple"]
    assert strong["pitch_m"] == pytest.approx(rig.RIPPLE.pitch_m, rel=0.03)
    assert strong["amplitude"] == pytest.approx(4 * rig.RIPPLE.amplitude, rel=0.25)


def test_ripple_is_not_found_where_there_is_none() -> None:
    assert all(not identify_gated(cell_record(seed, ripple=0.0)).extras for seed in SEEDS)


def test_without_velocity_the_deviations_still_hold(records: list[AxisRecord]) -> None:
    bare = [replace(record, velocity_m_s=np.full(len(record), np.nan)) for record in records[:3]]
    assert np.abs(distances(bare)).max() < 3


def test_batch_is_the_biased_baseline(records: list[AxisRecord]) -> None:
    found, _ = identify_axis(records[0], "batch")
    assert found.method == "batch"
    assert found.fit.value("inertia") < 0.99 * rig.TRUE_AXIS.inertia


def test_model_selection_keeps_to_the_simple_where_that_is_the_truth(loop: MakeLoop) -> None:
    selection = select_axis_model(loop(reference=sine_reference(60.0)))
    assert selection.chosen.friction == "symmetric"
    assert "symmetric friction predicts parts left out" in selection.reason


def test_model_selection_sees_friction_of_two_kinds() -> None:
    reference = sine_reference(60.0)
    forward, backward = 12.0, 4.0
    record = record_loop(reference=reference, speed_noise_m_s=1e-4)
    twisted = record.command + np.where(
        np.roll(record.velocity_m_s, -1) > 0, 0.1 * forward, 0.1 * backward
    ) * np.roll(record.velocity_m_s, -1)
    assert select_axis_model(replace(record, command=twisted)).chosen.friction.startswith("asym")


def test_a_residual_that_follows_speed_is_called_so(loop: MakeLoop) -> None:
    record = loop(reference=sine_reference(60.0), speed_noise_m_s=1e-5)
    white = analyse_residual(identify_gated(record))
    assert not white.by_speed.is_sure
    drag = 2.0 * np.roll(record.velocity_m_s, -1) * np.abs(np.roll(record.velocity_m_s, -1))
    found = analyse_residual(identify_gated(replace(record, command=record.command + drag)))
    assert not found.is_white
    assert found.by_speed.is_sure or found.by_position.is_sure


def holed(record: AxisRecord) -> AxisRecord:
    keep = np.ones(len(record), dtype=np.bool_)
    keep[300:340] = keep[700:703] = False
    return record.rows(keep)


def repeated(record: AxisRecord) -> AxisRecord:
    rows = np.sort(np.concatenate([np.arange(len(record)), np.arange(100, 1400, 90)]))
    return record.rows(rows)


def with_nan(record: AxisRecord) -> AxisRecord:
    position, command = record.position_m.copy(), record.command.copy()
    position[::50] = np.nan
    command[25::50] = np.nan
    return replace(record, position_m=position, command=command)


def partly_saturated(record: AxisRecord) -> AxisRecord:
    wrong = np.arange(len(record)) % 10 == 0
    return replace(record, saturated=wrong, command=np.where(wrong, 99.0, record.command))


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (holed, "uneven steps of up to 1.64 s were left out"),
        (repeated, "messages whose stamp did not rise were left out"),
        (with_nan, "without position or command were left out"),
    ],
)
def test_bad_rows_are_left_out_and_said(
    spoil: Callable[[AxisRecord], AxisRecord], told: str, loop: MakeLoop
) -> None:
    found = identify_gated(spoil(loop(reference=sine_reference(60.0))))
    np.testing.assert_allclose(found.fit.values[:3], [1.0, 2.14, 0.214], rtol=0.01)
    assert any(told in note for note in found.notes), found.notes


def test_saturated_commands_are_left_out_and_said(loop: MakeLoop) -> None:
    found = identify_gated(partly_saturated(loop(reference=sine_reference(120.0))))
    np.testing.assert_allclose(found.fit.values[:3], [1.0, 2.14, 0.214], rtol=0.03)
    assert any("saturated command were left out" in note for note in found.notes)


def test_saturation_throughout_is_refused(loop: MakeLoop) -> None:
    record = loop()
    full = replace(record, saturated=np.ones(len(record), dtype=np.bool_))
    with pytest.raises(EvidenceError, match="saturated in 100 %"):
        identify_axis(full)


def test_a_constant_or_missing_command_is_refused(loop: MakeLoop) -> None:
    record = loop()
    with pytest.raises(EvidenceError, match="2 throughout"):
        identify_axis(replace(record, command=np.full(len(record), 2.0)))
    with pytest.raises(EvidenceError, match="0 with a command"):
        identify_axis(replace(record, command=np.full(len(record), np.nan)))


def test_a_law_that_is_no_cascade_is_not_taken_for_one(loop: MakeLoop) -> None:
    with pytest.raises(EvidenceError, match="do not follow from reference"):
        fit_servo(loop())
    record = loop()
    with pytest.raises(EvidenceError, match="no /table/reference"):
        fit_servo(replace(record, reference_m=np.full(len(record), np.nan)))
