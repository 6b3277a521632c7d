"""Foreign logs to sessions: what is taken over, what is told, what is refused."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from seamlog.cli import run
from seamlog.errors import ConfigError, ImportFailed
from seamlog.recorder.importers.column_map import load_column_map
from seamlog.recorder.importers.csv import CsvImporter
from seamlog.recorder.importers.mat import MatImporter
from seamlog.session import open_session

MAP = """
[time]
column = "t"
start = 2020-05-01T10:00:00Z

[channels."/table/encoder".fields]
position_m = { column = "pos", unit = "mm", scale = 2.0, offset = 1.0 }

[channels."/table/command"]
metadata = { unit = "V", force_per_unit = { column = "gain" } }
fields.command = { column = "u" }
"""
Files = Callable[..., tuple[Path, Path]]


@pytest.fixture
def files(tmp_path: Path) -> Files:
    def make(text: str = MAP, **columns: object) -> tuple[Path, Path]:
        content = {
            "t": np.arange(5.0)[:, None] / 10,
            "pos": np.array([1.0, 2.0, np.nan, 4.0, 5.0])[:, None],
            "u": np.arange(5.0)[:, None],
            "gain": 35.15,
            "spare": np.ones((5, 1)),
        }
        scipy.io.savemat(tmp_path / "log.mat", content | columns)
        (tmp_path / "map.toml").write_text(text)
        return tmp_path / "log.mat", tmp_path / "map.toml"

    return make


def run_import(log: Path, mapping: Path, *more: str) -> int:
    return run(["import", str(log), "--map", str(mapping), *more])


def test_values_are_scaled_shifted_and_brought_to_si(files: Files, tmp_path: Path) -> None:
    assert run_import(*files(), "-o", str(tmp_path / "s.mcap")) == 0
    with open_session(tmp_path / "s.mcap") as session:
        encoder = session.columns("/table/encoder")
        np.testing.assert_allclose(encoder["position_m"], [3e-3, 5e-3, np.nan, 9e-3, 11e-3])
        assert encoder["stamp_ns"][1] - encoder["stamp_ns"][0] == 100_000_000
        assert encoder["stamp_ns"][0] == 1_588_327_200_000_000_000
        assert session.channel_metadata("/table/command")["force_per_unit"] == "35.15"


def test_nothing_is_derived(files: Files, tmp_path: Path) -> None:
    assert run_import(*files(), "-o", str(tmp_path / "s.mcap")) == 0
    with open_session(tmp_path / "s.mcap") as session:
        assert np.isnan(session.columns("/table/encoder")["velocity_m_s"]).all()
        assert session.channel_metadata("/table/encoder")["absent"] == "velocity_m_s"


def test_the_loss_report_names_everything(
    files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_import(*files(), "--dry-run", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["rows"] == 5
    assert told["not_imported"] == ["spare"]
    assert told["absent"]["/table/command"] == ["saturated"]
    assert told["missing_values"] == {"/table/encoder position_m": 1}
    assert not list(tmp_path.glob("*.mcap"))


def test_all_faults_of_a_map_come_at_once(files: Files) -> None:
    text = MAP.replace("pos", "poss").replace("/table/command", "/table/comand")
    log, mapping = files(text.replace("[time]", "[time]\nrates = 3"))
    with pytest.raises(ConfigError) as caught:
        load_column_map(mapping, MatImporter().load(log).columns)
    assert len(caught.value.faults) == 4
    message = str(caught.value)
    assert "time.rates" in message
    assert "/table/comand: no such topic; did you mean '/table/command'?" in message
    assert "no column 'poss'; did you mean 'pos'?" in message
    assert "poss" in message and "position_m" in message


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('column = "t"', "unit = 's'", "give either column or rate_hz"),
        ("T10:00:00Z", "T10:00:00", "time zone"),
        ('unit = "mm"', 'unit = "furlong"', "cannot turn 'furlong' into 'm'"),
        ('{ column = "u" }', "{ constant = 1, column = 'u' }", "either column or constant"),
        ("fields.command", "fields.comand", "did you mean 'command'"),
        ('{ column = "gain" }', '{ column = "gane" }', "no column 'gane'"),
    ],
)
def test_a_fault_of_a_map_says_where_and_what(
    files: Files, old: str, new: str, message: str
) -> None:
    assert old in MAP
    log, mapping = files(MAP.replace(old, new))
    with pytest.raises(ConfigError, match=message):
        load_column_map(mapping, MatImporter().load(log).columns)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0.0, 0.1, 0.1, 0.1, 0.1], "row 3"),
        ([0.0, 0.1, 0.2, 0.15, 0.3], "row 4"),
        ([0.0, np.nan, 0.2, 0.3, 0.4], "no value in row 2"),
    ],
)
def test_time_that_does_not_increase_is_refused_with_its_row(
    files: Files,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    times: list[float],
    message: str,
) -> None:
    log, mapping = files(t=np.array(times)[:, None])
    assert run_import(log, mapping, "-o", str(tmp_path / "s.mcap")) == 3
    assert message in capsys.readouterr().err
    assert not (tmp_path / "s.mcap").exists()


def test_columns_of_another_length_are_refused(files: Files) -> None:
    log, mapping = files(pos=np.ones((4, 1)))
    assert run_import(log, mapping, "--dry-run") == 3


def test_time_may_come_from_a_rate(files: Files, tmp_path: Path) -> None:
    text = MAP.replace('column = "t"', "rate_hz = 250")
    assert run_import(*files(text), "-o", str(tmp_path / "s.mcap")) == 0
    with open_session(tmp_path / "s.mcap") as session:
        stamps = session.columns("/table/command")["stamp_ns"]
        assert np.diff(stamps).tolist() == [4_000_000] * 4


def test_an_existing_session_is_kept(files: Files, tmp_path: Path) -> None:
    (tmp_path / "s.mcap").write_bytes(b"mine")
    assert run_import(*files(), "-o", str(tmp_path / "s.mcap")) == 2
    assert (tmp_path / "s.mcap").read_bytes() == b"mine"


def test_an_unknown_suffix_lists_the_importers(
    files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, mapping = files()
    (tmp_path / "log.xyz").write_bytes(b"x")
    assert run_import(tmp_path / "log.xyz", mapping, "--dry-run") == 2
    assert "csv, mat" in capsys.readouterr().err


def test_a_cut_matlab_73_file_is_refused(tmp_path: Path) -> None:
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    (tmp_path / "new.mat").write_bytes(head.ljust(512, b"\0") + b"\x89HDF\r\n\x1a\n" + b"\0" * 600)
    with pytest.raises(ImportFailed, match=r"new\.mat cannot be read"):
        MatImporter().load(tmp_path / "new.mat")


def test_times_that_repeat_and_gaps_are_counted(
    files: Files, capsys: pytest.CaptureFixture[str]
) -> None:
    log, mapping = files(t=np.array([0.0, 0.1, 0.1, 0.2, 0.9])[:, None])
    assert run_import(log, mapping, "--dry-run", "--json") == 0
    timing = json.loads(capsys.readouterr().out)["timing"]["/table/encoder"]
    assert timing["repeated"] == 1
    assert timing["gaps"] == 1
    assert timing["longest_gap_s"] == pytest.approx(0.7)


@pytest.mark.parametrize("content", [b"", b"no matlab file at all" * 20, b"\0" * 200])
def test_a_foreign_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "bad.mat").write_bytes(content)
    with pytest.raises(ImportFailed, match=r"bad\.mat"):
        MatImporter().load(tmp_path / "bad.mat")


def test_structures_and_matrices_become_columns(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "s.mat", {"run": {"v": [1.0, 2.0]}, "m": np.eye(3), "name": "x"})
    columns = MatImporter().load(tmp_path / "s.mat").columns
    assert set(columns) == {"run.v", "m[0]", "m[1]", "m[2]"}
    several = np.array([([1.0, 2.0],), ([3.0, 4.0],)], dtype=[("v", object)])
    scipy.io.savemat(tmp_path / "t.mat", {"s": several, "wide": np.arange(20.0).reshape(2, 10)})
    columns = MatImporter().load(tmp_path / "t.mat").columns
    assert columns["s[1].v"].tolist() == [3.0, 4.0]
    assert columns["wide[1]"].tolist() == list(range(10, 20))
    columns = MatImporter().load(tmp_path / "s.mat").columns
    assert columns["run.v"].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_csv_columns_are_named_by_the_header(tmp_path: Path, separator: str) -> None:
    rows = ["t, x ,word", "0,1,a", "1,,b"]
    (tmp_path / "t.csv").write_text("\n".join(rows).replace(",", separator) + "\n")
    columns = CsvImporter().load(tmp_path / "t.csv").columns
    assert set(columns) == {"t", "x"}
    np.testing.assert_array_equal(columns["x"], [1.0, np.nan])


def test_a_csv_without_header_numbers_its_columns(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("0.0, 5, 6\n0.1, 7, 8\n")
    columns = CsvImporter().load(tmp_path / "t.csv").columns
    assert {name: list(column) for name, column in columns.items()} == {
        "column 1": [0.0, 0.1],
        "column 2": [5, 7],
        "column 3": [6, 8],
    }


@pytest.mark.parametrize("text", ["", "a,b\n", "a,b\nx,y\n"])
def test_a_csv_without_numbers_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(ImportFailed, match=r"t\.csv"):
        CsvImporter().load(tmp_path / "t.csv")
