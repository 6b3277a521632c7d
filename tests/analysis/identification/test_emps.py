"""The EMPS axis: the published tables, to every printed digit, from the imported session."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from seamlog.analysis.axis_record import AxisRecord, load_axis_record
from seamlog.analysis.identification.idim_ls import identify_idim_ls
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
    assert [f"{value:.4f}" for value in fit.sd] == ["0.1085", "1.1460", "0.1012", "0.0444"]
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
    assert "95.1089 +- 0.1085 kg" in told
    assert "203.5034 +- 1.1460 N s/m" in told


def test_gated_needs_the_velocity_that_the_record_lacks(
    emps: Session, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", str(emps.path), "--method", "gated"]) == 6
    assert "no velocity" in capsys.readouterr().err
