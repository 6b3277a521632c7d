"""Tables as they come: what cannot be told is refused or said, never taken for something else."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seamlog.cli import run
from seamlog.errors import ImportFailed
from seamlog.recorder.importers.csv import CsvImporter

NAN = float("nan")
MARCH_4 = 1_709_528_760 * 10**9
"""2024-03-04 05:06:00 UTC."""


def lines(*rows: str) -> str:
    return "\n".join(rows) + "\n"


def counted(form: str, head: str = "t,x", count: int = 6) -> str:
    return lines(head, *(form.format(i=i, j=i + 1) for i in range(count)))


def steps(first: int, step: int = 10**9, count: int = 6) -> list[int]:
    return [first + place * step for place in range(count)]


NUMBERS: dict[str, tuple[str, list[float]]] = {
    "thousands, German": (counted("{i},5;{j}.234,50", "t;x"), [1234.5, 2234.5, 3234.5]),
    "thousands without decimals": (counted("{i},5;{j}.234", "t;x"), [1234, 2234, 3234]),
    "thousands, American": (counted('{i}.5,"{j},234.5"'), [1234.5, 2234.5, 3234.5]),
    "thousands, Swiss": (counted("{i}.5;{j}'234.5", "t;x"), [1234.5, 2234.5, 3234.5]),
    "thousands, narrow space": (counted("{i},5;{j}\u202f234,5", "t;x"), [1234.5, 2234.5]),
    "thousands in some rows": (
        lines("t;x", "0,5;998,25", "1,5;1.001,5", "2,5;12.345.678,5"), [998.25, 1001.5, 12345678.5]
    ),
    "point where others have a comma": (counted("{i},5;0.{j}25", "t;x"), [0.125, 0.225, 0.325]),
    "quoted decimal comma": (counted('"{i},5","{j},25"'), [1.25, 2.25, 3.25]),
    "exponent with a comma": (counted("{i},0E+00;{j},5E-03", "t;x"), [0.0015, 0.0025]),
    "Fortran": (counted("  {i}.0D+00   {j}.5D-03", "t x"), [0.0015, 0.0025]),
    "minus as typeset": (counted("{i},\u2212{j}.5"), [-1.5, -2.5, -3.5]),
    "formulas of a spreadsheet": (counted('="{i}",="{j}"'), [1, 2, 3]),
    "flags": (lines("t,x", "0,TRUE", "1,FALSE", "2,"), [1, 0, NAN]),
    "words for nothing": (lines("t,x", "0,1.5", "1,n/a", "2,---", "3,-1.#IND"), [1.5, NAN, NAN]),
    "units in the cells": (counted("{i} s,{j}.5 mm"), [1.5, 2.5, 3.5]),
    "summary below": (counted("{i},{j}") + lines("", "Mean,3.5", "Max,6"), [1, 2, 3, 4, 5, 6]),
    "words below": (counted("{i},{j}") + lines("", "Operator: Max"), [1, 2, 3, 4, 5, 6]),
    "comments between": (lines("# v1", "t,x", "0,1", "# pause", "1,2", "2,3"), [1, 2, 3]),
    "line breaks in cells": (lines('"t\n(s)","x","n"', '0,1,"a\nb, c"', '1,2,"d"'), [1, 2]),
    "line breaks above": (lines('Who,"Max\nMoritz"', "", "t,x", "0,1", "1,2"), [1, 2]),
    "a stray quote above": (lines('Screen 15" used', "t,x", "0,1", "1,2"), [1, 2]),
    "old Macintosh": (counted("{i},{j}").replace("\n", "\r"), [1, 2, 3, 4, 5, 6]),
    "name, unit, remark": (
        lines("N,t,x", "Unit,s,mm", "Remark,time,place", ",0,1", ",1,2"), [1, 2]
    ),
    "the header again": (counted("{i},{j}") + lines("t,x", "6,7"), [1, 2, 3, 4, 5, 6, 7]),
    "words in the first rows": (
        lines("t,x,y", "0,1,2", "1,off,off", *(f"{i},{i + 1},7" for i in range(2, 9))), [1, NAN, 3]
    ),
    "a blank line below the header": (lines("t,x", "(ms),(mV)", "", "0,1", "1,2"), [1, 2]),
    "numbers for names": (lines("Time,1,x", "0,5,1", "1,5,2", "2,5,3"), [1, 2, 3]),
    "a remark in some rows": (lines("t,x,remark", "0,1", "1,2,start", "2,3"), [1, 2, 3]),
    "a trigger line above": (
        lines("LECROY,Waveform", "#1,12-Dec-2014 16:02:01,0", "t,x", "-0.1,1", "0,2"), [1, 2]
    ),
    "last cells empty, no header": (lines("0,1,", "1,2,3", "2,3,", "3,4,"), []),
    "rule below the header": (lines("|t|x|", "|---|---|", "|0|1|", "|1|2|"), [1, 2]),
}  # fmt: skip


def load(path: Path, text: str, encoding: str = "utf-8") -> Any:
    path.write_bytes(text.encode(encoding))
    return CsvImporter().load(path)


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_are_told(tmp_path: Path, name: str) -> None:
    text, wanted = NUMBERS[name]
    columns = load(tmp_path / "t.csv", text).columns
    found = columns["x" if wanted else "column 3"]
    np.testing.assert_array_equal(found[: len(wanted)], wanted)
    assert len(found) >= len(wanted)


TIMES: dict[str, tuple[str, list[int]]] = {
    "zones": (
        lines("t,x", "2024-03-31T01:59:59+01:00,1", "2024-03-31T03:00:00+02:00,2"),
        steps(1_711_846_799 * 10**9, count=2),
    ),
    "nanoseconds": (
        lines("t,x", "2024-03-04T05:06:00.000000001Z,1", "2024-03-04T05:06:00.5Z,2"),
        [MARCH_4 + 1, MARCH_4 + 500_000_000],
    ),
    "year first, slashes": (counted("2024/03/04 05:06:0{i},1"), steps(MARCH_4)),
    "day first, comma": (counted("04.03.2024 05:06:0{i},5;1", "t;x"), steps(MARCH_4 + 10**9 // 2)),
    "day first, proved late": (
        lines("t;x", *(f"{day}/03/2024 05:06;1" for day in (11, 12, 13))),
        steps(MARCH_4 + 7 * 86_400 * 10**9, 86_400 * 10**9, 3),
    ),
    "days go on, months do not": (
        lines("t,x", *(f"{day:02d}/03/2024 05:06,1" for day in (4, 5, 6))),
        steps(MARCH_4, 86_400 * 10**9, 3),
    ),
    "twelve hours": (
        lines("t,x", "3/4/2024 5:06:00 AM,1", "3/4/2024 5:06:00 PM,2"),
        steps(MARCH_4, 43_200 * 10**9, 2),
    ),
    "names of months": (counted("04-Mar-2024 05:06:0{i},1"), steps(MARCH_4)),
    "German months": (counted("4. März 2024 05:06:0{i},1"), steps(MARCH_4)),
    "without signs": (counted("20240304T05060{i}Z,1"), steps(MARCH_4)),
    "for names of files": (counted("2024-03-04_05-06-0{i},1"), steps(MARCH_4)),
    "as C writes it": (counted("Mon Mar  4 05:06:0{i} 2024,1"), steps(MARCH_4)),
    "noon": (lines("t,x", "11:59:59 AM,1", "12:00:00 PM,2"), steps(43_199 * 10**9, count=2)),
    "minutes and seconds": (counted("59:5{i}.5,1"), steps(3590 * 10**9 + 5 * 10**8)),
    "milliseconds behind a colon": (counted("12:00:0{i}:250,1"), steps(43_200_250_000_000)),
    "past midnight": (
        lines("t,x", "23:59:58,1", "23:59:59,2", "00:00:00,3"), steps(86_398 * 10**9, count=3)
    ),
    "date and time apart": (
        lines("Day;t;x", "03.03.2024;23:59:59,5;1", "04.03.2024;00:00:00,5;2"),
        steps(1_709_510_399_500_000_000, count=2),
    ),
    "whole ns": (counted("170952876000000000{i},1"), steps(MARCH_4, 1)),
}  # fmt: skip


@pytest.mark.parametrize("name", TIMES)
def test_times_are_told(tmp_path: Path, name: str) -> None:
    text, wanted = TIMES[name]
    columns = load(tmp_path / "t.csv", text).columns
    assert columns["Day t" if "Day t" in columns else "t"].tolist() == wanted


def test_encodings_without_a_mark(tmp_path: Path) -> None:
    text = counted("{i},{j}.5")
    for encoding in ("utf-16-le", "utf-16-be"):
        assert load(tmp_path / "t.csv", text, encoding).columns["x"][1] == 2.5
    content = load(tmp_path / "t.csv", text + "\0" * 400)
    assert content.columns["x"][-1] == 6.5
    assert any("400 empty bytes" in note for note in content.notes)


def test_tables_side_by_side_of_different_length(tmp_path: Path) -> None:
    rows = ["0;1;;0;7", "1;2;;5;8", "2;3;;;", "3;4;;;"]
    columns = load(tmp_path / "t.csv", lines("t1;x1;;t2;x2", *rows)).columns
    assert [len(column) for column in columns.values()] == [4, 4, 2, 2]


REFUSED = {
    "commas everywhere": (counted("{i},5,{j},25"), "separate decimals as well"),
    "thousands without quotes": (
        lines("t,x,y", "0,995,2", "1,998,2", *(f"{i},1,{i:03d},2" for i in range(2, 40))),
        "line 4 has 4 cells, line 2 has 3, the line above 3",
    ),
    "thousands without quotes, no header": (
        lines("0,995,2", "1,998,2", *(f"{i},1,{i:03d},2" for i in range(2, 40))),
        "line 3 has 4 cells, line 1 has 3",
    ),
    "a longer row": (counted("{i},{j}", count=300) + "300,1,234\n", "row 301"),
    "two tables": (counted("{i},{j}") + "\nu,v\n" + counted("{i},{j}", "u,v", 9), "split the file"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_told_is_refused(tmp_path: Path, name: str) -> None:
    text, said = REFUSED[name]
    with pytest.raises(ImportFailed, match=said):
        load(tmp_path / "t.csv", text)


LEFT_OUT = {
    "thousands or decimals": (counted('{i},"{j},234"'), "nothing in the file tells"),
    "ratios are no times": (counted("{i};1:{j}", "t;x"), "holds text"),
    "name of a zone": (counted("{i},2024-03-04 05:06:0{i} CST"), "such as \\+01:00"),
    "no such day": (counted("{i},2024-02-3{i}", count=5), "no such date"),
    "both orders": (lines("t,x", "0,13/02/2024", "1,02/13/2024"), "day first in some rows"),
}


@pytest.mark.parametrize("name", LEFT_OUT)
def test_columns_that_cannot_be_told_are_left_out(tmp_path: Path, name: str) -> None:
    text, said = LEFT_OUT[name]
    content = load(tmp_path / "t.csv", text)
    assert "x" not in content.columns
    assert any(re.search(said, note) for note in content.notes)


GUESSES = {
    "microseconds": (counted("{i}000,1", "time [µs],x"), 'unit = "us"  # as the file says'),
    "spreadsheet days": (counted("45355.{j},1", "Date,x"), "start = 1899-12-30T00:00:00Z"),
    "MATLAB days": (counted("739315.{j},1", "t,x"), 'unit = "datenum"'),
    "LabVIEW seconds": (counted("379238120{i}.25,1", "Time,x"), "start = 1904-01-01T00:00:00Z"),
    "times before zero": (lines("t,x", "-0.2,1", "-0.1,2", "0,3"), "start = 1970-01-02T00:00:00Z"),
    "centimetres": (counted("{i},1", "t / s,position / cm"), 'unit = "cm" }'),
}


@pytest.mark.parametrize("name", GUESSES)
def test_guesses(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text, said = GUESSES[name]
    (tmp_path / "t.csv").write_text(text)
    assert run(["import", str(tmp_path / "t.csv"), "--guess"]) == 0
    assert said in capsys.readouterr().out


def test_guesses_leave_out_what_has_another_length(tmp_path: Path, capsys: Any) -> None:
    rows = ["0;1;;0;7", "1;2;;5;8", "2;3;;;", "3;4;;;"]
    (tmp_path / "t.csv").write_text(lines("t;x;;u;y", *rows))
    assert run(["import", str(tmp_path / "t.csv"), "--guess"]) == 0
    assert "# y: 2 values, 4 times, not mapped" in capsys.readouterr().out
    (tmp_path / "t.csv").write_text(lines("t;x", "0;a", "1;b", "2;c"))
    assert run(["import", str(tmp_path / "t.csv"), "--guess"]) == 3
    assert "column 'x' holds text" in capsys.readouterr().err


def test_units_stand_in_many_places(tmp_path: Path) -> None:
    heads = {
        "t [s];x [mm]": "0;1", "t / s;x / mm": "0;1", "t in s;x in mm": "0;1", "t;x\ns;mm": "0;1",
        "t;x\n[s];[mm]": "0;1", "t;x;unit": "0 s;1;mm", "t;x": "0 s;1 mm",
    }  # fmt: skip
    for head, row in heads.items():
        units = load(tmp_path / "t.csv", lines(head, row, row, row)).units
        assert sorted(units.values()) == ["mm", "s"], head
    assert load(tmp_path / "t.csv", lines("t,x (actual)", "0,1", "1,2")).units == {}


@pytest.mark.parametrize(
    ("data", "said"), [(b"PK\x03\x04", "Excel"), (b"<html>", "markup"), (b'{"a": 1}', "JSON")]
)
def test_files_of_other_kinds_are_named(tmp_path: Path, data: bytes, said: str) -> None:
    (tmp_path / "t.csv").write_bytes(data)
    with pytest.raises(ImportFailed, match=said):
        CsvImporter().load(tmp_path / "t.csv")


def imported(tmp_path: Path, text: str, mapping: str, capsys: Any) -> tuple[int, dict[str, Any]]:
    (tmp_path / "t.csv").write_text(text)
    (tmp_path / "m.toml").write_text(mapping)
    words = ["import", str(tmp_path / "t.csv"), "--map", str(tmp_path / "m.toml"), "--json"]
    code = run([*words, "-o", str(tmp_path / "s.mcap")])
    out = capsys.readouterr()
    return code, json.loads(out.out)


POSITION = '[time]\ncolumn = "t"\n[channels."/table/encoder".fields]\nposition_m.column = "x"\n'


def test_cells_that_are_lost_are_said_and_end_with_1(tmp_path: Path, capsys: Any) -> None:
    text = lines("t,x,y", *(f"{i},{'OVL' if i == 3 else i},err" for i in range(9)))
    code, told = imported(tmp_path, text, POSITION, capsys)
    assert code == 1
    assert told["losses"] == [
        "column 'x': 1 cells are no numbers and count as missing, the first 'OVL' in row 4"
    ]
    assert told["missing_values"] == {"/table/encoder position_m": 1}
    code, told = imported(tmp_path, text.replace("OVL", ""), POSITION, capsys)
    assert code == 2  # the session is there already


def test_lines_that_are_no_rows_are_losses(tmp_path: Path, capsys: Any) -> None:
    text = lines("t,x", "0,1", "1,2", "stopped by operator,", "2,3", "3,4")
    code, told = imported(tmp_path, text, POSITION, capsys)
    assert (code, told["rows"]) == (1, 4)
    assert "stopped by operator" in told["losses"][0]


def test_a_unit_that_no_field_has_is_not_taken_for_metres(tmp_path: Path, capsys: Any) -> None:
    code, told = imported(tmp_path, counted("{i},{j}", "t,x [deg]"), POSITION_DEG, capsys)
    assert code == 2
    assert "cannot turn 'deg' into 'm'" in told["message"]


POSITION_DEG = POSITION.replace('"x"', '"x [deg]"')


def test_a_table_longer_than_a_hall_is_doubted(tmp_path: Path, capsys: Any) -> None:
    _, told = imported(tmp_path, counted("{i},{j}00"), POSITION, capsys)
    assert "/table/encoder position_m spans 500 m: is its unit right?" in told["notes"]


def test_values_that_a_field_cannot_hold_are_refused(tmp_path: Path, capsys: Any) -> None:
    mapping = '[time]\ncolumn = "t"\n[channels."/events".fields]\nkind.column = "x"\n'
    code, told = imported(tmp_path, counted("{i},{j}.5"), mapping, capsys)
    assert (code, "row 1 has 1.5 for kind" in told["message"]) == (3, True)


def test_coarse_times_are_said(tmp_path: Path, capsys: Any) -> None:
    _, told = imported(tmp_path, counted("1709528760.00000{i},{j}"), POSITION, capsys)
    assert any("in steps of 2.4e+02 ns" in note for note in told["notes"])
    mapping = POSITION.replace('"t"', '"t"\nunit = "datenum"')
    (tmp_path / "s.mcap").unlink()
    _, told = imported(tmp_path, counted("739315.2{j},{j}"), mapping, capsys)
    assert told["start_ns"] // (86_400 * 10**9) == MARCH_4 // (86_400 * 10**9)
