"""Identification of loops whose truth is known, and refusal of motion that cannot tell."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seamlog.analysis.axis_record import AxisRecord, Drive
from seamlog.analysis.closed_loop import Reference
from seamlog.analysis.identification.excitation import judge_excitation
from seamlog.analysis.identification.gated import identify_gated
from seamlog.analysis.identification.identify import identify_axis
from seamlog.analysis.identification.method import Identification
from seamlog.analysis.identification.part import Doubts, identification_part
from seamlog.analysis.identification.regression import least_squares
from seamlog.analysis.identification.residuals import analyse_residual
from seamlog.cli import run
from seamlog.contracts import Axis
from seamlog.errors import EvidenceError
from tests.analysis.conftest import record_loop, sine_reference

MakeLoop = Callable[..., AxisRecord]
TRUTH = Axis(1.0, 2.14, 0.214, saturation=20.0, unit="N m")


def line(speed_m_s: float, seconds: float = 30.0) -> Reference:
    time = np.asarray(0.04 * np.arange(round(seconds / 0.04)), dtype=np.float64)
    return Reference(
        np.multiply(speed_m_s, time), np.full(len(time), speed_m_s), np.zeros(len(time))
    )


def test_the_truth_is_found_exactly_without_noise(loop: MakeLoop) -> None:
    record = loop(truth=replace(TRUTH, offset=0.05), speed_noise_m_s=0.0)
    fit = identify_gated(record).fit
    np.testing.assert_allclose(fit.values, [1.0, 2.14, 0.214, 0.05], rtol=2e-4)


@settings(max_examples=15, deadline=None)
@given(
    inertia=st.floats(0.3, 60.0),
    viscous_rate_1_s=st.floats(0.2, 5.0),
    friction_m_s2=st.floats(0.05, 0.4),
    offset_share=st.floats(-0.5, 0.5),
)
def test_any_axis_is_found_exactly_without_noise(
    inertia: float, viscous_rate_1_s: float, friction_m_s2: float, offset_share: float
) -> None:
    friction = inertia * friction_m_s2
    truth = Axis(inertia, inertia * viscous_rate_1_s, friction, friction * offset_share)
    fit = identify_gated(record_loop(truth=truth, speed_noise_m_s=0.0)).fit
    wanted = [truth.inertia, truth.viscous_friction, truth.coulomb_friction, truth.offset]
    np.testing.assert_allclose(fit.values, wanted, rtol=1e-3, atol=1e-3 * inertia)


@pytest.mark.parametrize("seed", range(3))
def test_the_truth_is_found_within_its_deviation(loop: MakeLoop, seed: int) -> None:
    found, why = identify_axis(loop(seed=seed))
    assert found.method == "gated" and "25 Hz" in why
    truth = np.array([1.0, 2.14, 0.214, 0.0])
    np.testing.assert_allclose(found.fit.values[:3], truth[:3], rtol=0.02)
    assert np.all(np.abs(found.fit.values - truth) < 5 * found.fit.sd)


def test_friction_of_each_direction_is_told_apart(loop: MakeLoop) -> None:
    record = loop(truth=replace(TRUTH, offset=0.05), speed_noise_m_s=0.0)
    fit = identify_gated(record, "asymmetric").fit
    assert fit.value("coulomb_friction_positive") == pytest.approx(0.264, rel=1e-3)
    assert fit.value("coulomb_friction_negative") == pytest.approx(0.164, rel=1e-3)


def test_values_scale_with_the_force_of_the_drive(loop: MakeLoop) -> None:
    record = loop()
    volts = replace(record, drive=Drive("V", 10.0, "N"))
    one, ten = identify_gated(record), identify_gated(volts)
    np.testing.assert_allclose(ten.fit.values, 10 * one.fit.values)
    assert ten.unit == "N" and one.unit == "N m"


def test_a_dropped_message_does_not_bias(loop: MakeLoop) -> None:
    record = loop(speed_noise_m_s=0.0)
    kept = np.ones(len(record), dtype=np.bool_)
    kept[[100, 101, 333, 500]] = False
    fit = identify_gated(record.rows(kept)).fit
    np.testing.assert_allclose(fit.values[:3], [1.0, 2.14, 0.214], rtol=1e-2)


@pytest.mark.parametrize("speed_m_s", [0.03, -0.03])
def test_one_way_motion_is_refused(loop: MakeLoop, speed_m_s: float) -> None:
    with pytest.raises(EvidenceError, match="one way only"):
        identify_axis(loop(reference=line(speed_m_s)))


def test_an_axis_at_rest_is_refused(loop: MakeLoop) -> None:
    with pytest.raises(EvidenceError, match="to and fro"):
        identify_axis(loop(reference=line(0.0)))


def test_a_slow_loop_without_velocity_is_smoothed(loop: MakeLoop) -> None:
    record = loop(reference=sine_reference(60.0))
    bare = replace(record, velocity_m_s=np.full(len(record), np.nan))
    found, _ = identify_axis(bare)
    np.testing.assert_allclose(found.fit.values[:3], [1.0, 2.14, 0.214], rtol=0.01)
    assert "the record has no velocity: it was smoothed from the positions" in found.notes
    with pytest.raises(EvidenceError, match="needs 200 Hz"):
        identify_axis(bare, "idim-ls")
    coarse = replace(bare, position_m=np.round(bare.position_m / 1e-4) * 1e-4)
    with pytest.raises(EvidenceError, match="would bias the inertia"):
        identify_axis(coarse)


def test_refusal_is_exit_code_6_and_no_number(
    loop: MakeLoop,
    session_of: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = session_of(loop(reference=line(0.03)))
    assert run(["identify", str(path), "-o", str(tmp_path / "r")]) == 6
    captured = capsys.readouterr()
    assert captured.out == "" and "one way only" in captured.err
    assert not (tmp_path / "r").exists()


def test_parameters_that_the_motion_mixes_are_named() -> None:
    step = np.repeat([1.0, -1.0], 50)
    regressor = np.column_stack([np.sin(np.arange(100)), step, 2 * step])
    with pytest.raises(EvidenceError, match="cannot tell b and c apart"):
        least_squares(("a", "b", "c"), regressor, step, np.arange(100))


def test_the_deviation_of_a_correlated_residual_is_not_understated() -> None:
    random = np.random.default_rng(3)
    regressor = np.column_stack([np.ones(400), np.repeat(np.tile([0.0, 1.0], 10), 20)])
    values = []
    deviations = []
    for _ in range(200):
        noise = np.convolve(random.normal(size=429), np.ones(30), "valid")
        fit = least_squares(("a", "b"), regressor, noise, np.arange(400) // 40)
        values.append(fit.values[0])
        deviations.append(fit.sd[0])
    assert np.mean(deviations) == pytest.approx(np.std(values), rel=0.35)


def test_weak_motion_is_called_weak(loop: MakeLoop) -> None:
    time = 0.04 * np.arange(750)
    slow = Reference(
        0.1 * np.sin(0.2 * time), 0.02 * np.cos(0.2 * time), -0.004 * np.sin(0.2 * time)
    )
    verdict = judge_excitation(identify_gated(loop(reference=slow, speed_noise_m_s=5e-3)))
    assert verdict.verdict == "weak"
    assert any("inertia" in reason for reason in verdict.reasons)


def test_a_value_that_no_axis_has_is_not_stated(loop: MakeLoop) -> None:
    record = loop()
    backwards = replace(record, command=-record.command)
    part, _ = identification_part(*_judged(backwards), [], [])
    for name in ("inertia", "viscous_friction", "coulomb_friction"):
        figure = part.figure(name)
        assert figure is not None and figure.value is None and "no axis has" in figure.reason


def _judged(record: AxisRecord) -> tuple[Identification, str, Doubts]:
    found, why = identify_axis(record)
    return found, why, Doubts(judge_excitation(found), analyse_residual(found), None)


def test_a_reference_with_faults_lists_them(
    loop: MakeLoop,
    session_of: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "ref.toml").write_text('[symmetric]\ninertia = { vale = 1 }\noffset = "x"\n')
    path = session_of(loop())
    assert run(["identify", str(path), "--compare", str(tmp_path / "ref.toml")]) == 2
    message = capsys.readouterr().err
    assert "source" in message and "inertia.vale" in message and "symmetric.offset" in message
