"""Text tables as loggers and spreadsheets really write them."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seamlog.errors import SeamlogError
from seamlog.recorder.importers.csv import CsvImporter

NAN = float("nan")
SIGNS = "0123456789.,;\t -:/eE\n\"'#aZ[]()"


class Table(NamedTuple):
    """A file, its encoding, and what must come out of it."""

    text: str
    encoding: str
    columns: dict[str, list[float]]
    units: dict[str, str]


T1, T2 = 1577836800001000000, 1577836800002000000
D1, D2 = 1580551200000000000, 1580551201000000000
XY = {"X p": [0.0, 1], "X v": [1.0, 2], "Y p": [2.0, 3], "Y v": [3.0, 4]}
BLOCKS = {"t": [0.0, 1], "x": [1.0, 2], "t.2": [0, 0.5, 1], "y": [5.0, 6, 7]}
TABLES = {
    "byte order mark": Table(
        "\ufefft,x [mm]\n0,1\n1,2\n", "utf-8", {"t": [0, 1], "x [mm]": [1, 2]}, {"x [mm]": "mm"}
    ),
    "utf-16, decimal comma": Table(
        "t;x\n0,5;1,25\n1,5;2,5\n", "utf-16", {"t": [0.5, 1.5], "x": [1.25, 2.5]}, {}
    ),
    "second line of units": Table(
        "Time,Pos\ns,mm\n0,1\n1,2\n",
        "utf-8",
        {"Time": [0, 1], "Pos": [1, 2]},
        {"Time": "s", "Pos": "mm"},
    ),
    "two header lines": Table("X,,Y,\np,v,p,v\n0,1,2,3\n1,2,3,4\n", "utf-8", XY, {}),
    "lines above": Table(
        "Logger 3\nDate;2020\n\nZeit (s);Strom (A)\n0,1;10,5\n0,2;11\n",
        "cp1252",
        {"Zeit (s)": [0.1, 0.2], "Strom (A)": [10.5, 11]},
        {"Zeit (s)": "s", "Strom (A)": "A"},
    ),
    "side by side": Table("t,x,,t,y\n0,1,,0,5\n1,2,,0.5,6\n,,,1,7\n", "utf-8", BLOCKS, {}),
    "blanks between columns": Table(
        "# t  x\n0   1\n1   2\n", "utf-8", {"t": [0, 1], "x": [1, 2]}, {}
    ),
    "missing cells": Table("a\tb\n1\t\n2\t3\n", "utf-8", {"a": [1, 2], "b": [NAN, 3]}, {}),
    "quoted names": Table(
        '"t","x, y"\n"0","1"\n"1","2"\n', "utf-8", {"t": [0, 1], "x, y": [1, 2]}, {}
    ),
    "trailing separator": Table("t,x,\n0,1,\n1,2,\n", "utf-8", {"t": [0, 1], "x": [1, 2]}, {}),
    "one column": Table("x\n1\n2\n3\n", "utf-8", {"x": [1, 2, 3]}, {}),
    "dates": Table(
        "time,x\n2020-01-01T00:00:00.001Z,1\n2020-01-01T00:00:00.002Z,2\n",
        "utf-8",
        {"time": [T1, T2], "x": [1, 2]},
        {"time": "ns"},
    ),
    "german dates": Table(
        "Datum;x\n01.02.2020 10:00:00;1,5\n01.02.2020 10:00:01;2,5\n",
        "cp1252",
        {"Datum": [D1, D2], "x": [1.5, 2.5]},
        {"Datum": "ns"},
    ),
    "over midnight": Table(
        "time,x\n23:59:59.9,1\n00:00:00.1,2\n",
        "utf-8",
        {"time": [86399900000000, 86400100000000], "x": [1, 2]},
        {"time": "ns"},
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_awkward_tables_are_read(tmp_path: Path, name: str) -> None:
    text, encoding, wanted, units = TABLES[name]
    (tmp_path / "t.csv").write_bytes(text.encode(encoding))
    content = CsvImporter().load(tmp_path / "t.csv")
    assert list(content.columns) == list(wanted)
    for column, values in wanted.items():
        np.testing.assert_array_equal(content.columns[column], values)
    assert content.units == units


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"a,b\n1,ab\n2,cd\n", "column 'b' holds text and was not imported"),
        (b"1,2\n3,4\n", "no header line"),
        ("Stra\xdfe,b\n1,2\n".encode("latin-1"), "Windows-1252"),
        (b"title\n\na,b\n1,2\n2,3\n", "1 line above the table"),
        (b"time,x\n2020-01-01 00:00:00,1\n2020-01-01 00:00:01,2\n", "no time zone"),
    ],
)
def test_what_was_decided_is_noted(tmp_path: Path, text: bytes, said: str) -> None:
    (tmp_path / "t.csv").write_bytes(text)
    assert any(said in note for note in CsvImporter().load(tmp_path / "t.csv").notes)


@settings(max_examples=150, deadline=None)
@given(
    st.binary(max_size=200)
    | st.text("0123456789.,;\t -:/eE\n\"'#aZ[]()", max_size=200).map(str.encode)
)
def test_any_bytes_are_a_table_or_refused(tmp_path_factory: Any, data: bytes) -> None:
    path = tmp_path_factory.mktemp("csv") / "t.csv"
    path.write_bytes(data)
    try:
        content = CsvImporter().load(path)
    except SeamlogError as error:
        assert str(path) in str(error)
    else:
        assert content.columns
