"""The EMPS axis: the published tables, to every printed digit, from the imported session."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord, load_axis_record
from seamlog.analysis.identification.identify import identify_axis, select_axis_model
from seamlog.analysis.identification.idim_iv import identify_idim_iv
from seamlog.analysis.identification.idim_ls import IdimSettings, identify_idim_ls
from seamlog.analysis.identification.servo import Servo, fit_servo, replay_error
from seamlog.cli import run
from seamlog.session import Session, open_session


@pytest.fixture(scope="module")
def emps(
    data_dir: Path, project: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Session]:
    path = tmp_path_factory.mktemp("emps") / "emps.mcap"
    log, mapping = data_dir / "emps" / "DATA_EMPS.mat", project / "examples" / "emps.map.toml"
    assert run(["import", str(log), "--map", str(mapping), "-o", str(path)]) == 0
    with open_session(path) as session:
        yield session


@pytest.fixture(scope="module")
def record(emps: Session) -> AxisRecord:
    return load_axis_record(emps)


def test_the_symmetric_table_to_every_printed_digit(record: AxisRecord) -> None:
    fit = identify_idim_ls(record).fit
    assert [f"{value:.4f}" for value in fit.values] == [
        "95.1089",
        "203.5034",
        "20.3935",
        "-3.1648",
    ]
    assert [f"{value:.4f}" for value in fit.white_sd] == ["0.1085", "1.1460", "0.1012", "0.0444"]
    assert f"{fit.condition_number:.4f}" == "25.9883"
    assert f"{fit.residual_norm:.4f}" == "108.7569"
    assert f"{100 * fit.relative_error:.4f}" == "4.0834"


def test_the_asymmetric_table_to_every_printed_digit(record: AxisRecord) -> None:
    fit = identify_idim_ls(record, "asymmetric").fit
    assert [f"{value:.4f}" for value in fit.values] == [
        "95.1540",
        "166.7061",
        "20.1440",
        "240.4236",
        "20.6277",
    ]
    assert f"{100 * fit.relative_error:.4f}" == "3.1117"


def test_identify_sets_the_published_values_beside(
    emps: Session, project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reference = project / "examples" / "emps.reference.toml"
    assert run(["identify", str(emps.path), "--compare", str(reference), "--json"]) == 0
    details = json.loads(capsys.readouterr().out)["details"]
    rows = {row["name"]: row for row in details["comparison"]}
    assert rows["inertia"]["published"] == 95.1089
    assert all(abs(row["identified"] - row["published"]) < 5e-5 for row in rows.values())
    assert abs(rows["offset"]["difference_sd"]) < 0.01
    assert details["method"] == "idim-ls"
    assert details["excitation"]["verdict"] == "sufficient"


def test_forces_are_in_newtons_through_the_metadata(
    emps: Session, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", str(emps.path)]) == 0
    told = capsys.readouterr().out
    assert "95.1089 +- 0.2244 kg" in told
    assert "203.5034 +- 7.4626 N s/m" in told


def test_deviations_allow_for_the_friction_that_the_model_lacks(record: AxisRecord) -> None:
    """The values of the richer model lie within the deviations of the poorer one."""
    poor = identify_idim_ls(record).fit
    rich = identify_idim_ls(record, "asymmetric").fit
    mean = 0.5 * (rich.value("viscous_friction_positive") + rich.value("viscous_friction_negative"))
    assert abs(rich.value("inertia") - poor.value("inertia")) < 2 * poor.deviation("inertia")
    assert abs(mean - poor.value("viscous_friction")) < 2 * poor.deviation("viscous_friction")
    assert np.all(poor.sd > 2 * poor.white_sd)


def test_cross_validation_chooses_a_model_within_2_3_percent(record: AxisRecord) -> None:
    selection = select_axis_model(record)
    chosen = selection.chosen
    assert chosen.friction == "asymmetric-stribeck"
    assert chosen.lag_periods == 0.75
    assert "symmetric friction to 4.1" in selection.reason
    settings = IdimSettings(lag_periods=chosen.lag_periods)
    assert identify_idim_ls(record, chosen.friction, settings).fit.relative_error < 0.023
    at_1_ms = identify_idim_ls(record, "asymmetric-stribeck", IdimSettings(lag_periods=1.0))
    assert f"{100 * at_1_ms.fit.relative_error:.2f}" == "2.20"


def test_the_drives_law_is_told_by_the_record_to_two_encoder_counts(record: AxisRecord) -> None:
    servo = fit_servo(record)
    assert servo.position_gain_1_s == pytest.approx(160.18, rel=1e-3)
    assert servo.velocity_gain == pytest.approx(243.45, rel=1e-3)
    assert servo.delay_periods == 0
    published = Servo(160.18, 243.45, window=2, delay_periods=0, relative_error=0.0)
    floor = replay_error(record, published)
    assert floor == pytest.approx(0.00238, abs=1e-5)
    for delay in (-1, 1):
        assert replay_error(record, replace(published, delay_periods=delay)) > 10 * floor


def test_simulation_in_closed_loop_and_alone(record: AxisRecord) -> None:
    found, _ = identify_axis(record, "output-error", "asymmetric-stribeck", lag_periods=0.75)
    loop = found.extras["closed_loop"]
    assert loop["position_error"] < 0.002
    assert loop["velocity_error"] < 0.13
    assert loop["force_error"] < 3.8
    assert found.extras["open_loop"]["position_rms_mm"] < 3.0
    assert found.fit.value("inertia") == pytest.approx(95.1, rel=0.01)


def test_simulated_instruments_confirm_least_squares(record: AxisRecord) -> None:
    fit = identify_idim_iv(record).fit
    wanted = [95.1089, 203.5034, 20.3935, -3.1648]
    np.testing.assert_allclose(fit.values, wanted, rtol=2e-3)


def test_at_40_ms_the_gated_form_stays_near(record: AxisRecord) -> None:
    """As a loop of 40 ms would have seen it: the mean command of each period, no speed."""
    count = len(record) // 40
    held = record.command[: 40 * count].reshape(count, 40).mean(axis=1)
    slow = replace(record.rows(slice(0, 40 * count, 40)), period_s=0.04, command=held)
    found, why = identify_axis(slow, delay_periods=0)
    assert found.method == "gated" and "below 200 Hz" in why
    assert any("smoothed from the positions" in note for note in found.notes)
    truth = np.array([95.1089, 203.5034, 20.3935])
    share = found.fit.values[:3] / truth - 1
    assert np.abs(share).max() < 0.05
    assert np.all(np.abs(found.fit.values[:3] - truth) < 3 * found.fit.sd[:3])


def test_a_model_is_judged_on_another_record(
    emps: Session, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["identify", str(emps.path), "--friction", "auto", "--validate", str(emps.path)]
    assert run([*arguments, "--json"]) == 0
    figures = {row["name"]: row for row in json.loads(capsys.readouterr().out)["figures"]}
    own = figures["relative_error"]["value"]
    assert figures["other_record_force_error"]["value"] == pytest.approx(own, rel=1e-9)
    assert figures["other_record_simulated_force_error"]["value"] < 4.0
