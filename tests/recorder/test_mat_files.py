"""MATLAB files of both formats as people save them; version 7.3 is made with h5py."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from seamlog.errors import ImportFailed
from seamlog.recorder.importers.mat import MatImporter, _arrays

h5py = pytest.importorskip("h5py")
TIME = np.arange(10) / 100
X = np.sin(TIME)


def load(path: Path, content: dict[str, Any]) -> Any:
    scipy.io.savemat(path / "a.mat", content)
    return MatImporter().load(path / "a.mat")


@pytest.mark.parametrize(
    ("matrix", "count"),
    [
        (np.column_stack([TIME, X, 2 * X]), 3),
        (np.vstack([TIME, X, 2 * X]), 3),
        (np.vstack([TIME, X, 2 * X, X, X, X, X, X, X]), 9),
    ],
)
def test_signals_of_a_matrix_stand_in_columns_or_rows(
    tmp_path: Path, matrix: Any, count: int
) -> None:
    for more in ({}, {"t": TIME}):
        columns = load(tmp_path, {"M": matrix} | more).columns
        assert [name for name in columns if name != "t"] == [f"M[{at}]" for at in range(count)]
        np.testing.assert_array_equal(columns["M[2]"], 2 * X)


def test_a_matrix_with_more_signals_than_samples_follows_the_vectors(tmp_path: Path) -> None:
    columns = load(tmp_path, {"t": TIME, "M": np.arange(200.0).reshape(10, 20)}).columns
    np.testing.assert_array_equal(columns["M[1]"], np.arange(1.0, 200, 20))


def test_what_matlab_has_besides_vectors(tmp_path: Path) -> None:
    content = {
        "z": X + 2j * X,
        "s": scipy.sparse.csc_matrix(X.reshape(-1, 1)),
        "c": np.array([X, "text", 2 * X], object),
        "dynamic": X.reshape(1, 1, -1),
        "big": np.array([2**53 + 1, -(2**63)], np.int64),
        "pictures": np.zeros((3, 3, 10)),
    }
    found = load(tmp_path, content)
    wanted = {"z.real": X, "z.imag": 2 * X, "s": X, "c[0]": X, "c[2]": 2 * X, "dynamic": X}
    for name, values in wanted.items():
        np.testing.assert_array_equal(found.columns[name], values)
    assert found.columns["big"].tolist() == [2**53 + 1, -(2**63)]
    assert {note.split()[1] for note in found.notes} == {"c[1]", "pictures"}


def test_objects_of_matlab_are_left_out_with_advice(tmp_path: Path) -> None:
    opaque = np.zeros(1, [("s0", object), ("arr", object)]).view(scipy.io.matlab.MatlabOpaque)
    notes: list[str] = []
    assert not dict(_arrays("T", opaque, notes))
    assert "table2struct" in notes[0]

    def fill(file: Any) -> None:
        put(file, "t", TIME)
        table = put(file, "T", np.full((6, 1), 3_707_764_736, np.uint32), "table")
        table.attrs["MATLAB_object_decode"] = np.int32(3)

    content = MatImporter().load(write_73(tmp_path, fill))
    assert list(content.columns) == ["t"]
    assert "variable T is an object of MATLAB" in content.notes[0]


def put(group: Any, name: str, values: Any, kind: str = "double") -> Any:
    data = group.create_dataset(name, data=values if values.ndim > 1 else values.reshape(1, -1))
    data.attrs["MATLAB_class"] = np.bytes_(kind)
    return data


def write_73(folder: Path, fill: Any) -> Path:
    path = folder / "b.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file)
    data = bytearray(path.read_bytes())
    data[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(data)
    return path


def test_version_73(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        run = file.create_group("run")
        run.attrs["MATLAB_class"] = np.bytes_("struct")
        put(run, "time", TIME)
        put(file, "M", np.vstack([TIME, X]).T)  # HDF5 holds it turned
        put(file, "count", np.array([2**53 + 1, 2**62], np.int64), "int64")
        both = np.zeros((1, 10), [("real", "<f8"), ("imag", "<f8")])
        both["imag"] = X
        put(file, "z", both)
        cells = file.create_group("#refs#")
        parts = [put(cells, name, values).ref for name, values in (("a", X), ("b", TIME))]
        put(file, "c", np.array([parts], h5py.ref_dtype), "cell")

    columns = MatImporter().load(write_73(tmp_path, fill)).columns
    assert columns["count"].tolist() == [2**53 + 1, 2**62]
    wanted = {"run.time": TIME, "M[0]": TIME, "M[1]": X, "z.imag": X, "c[0]": X, "c[1]": TIME}
    for name, values in wanted.items():
        np.testing.assert_array_equal(columns[name], values)


def test_a_file_without_numbers_says_what_it_holds(tmp_path: Path) -> None:
    with pytest.raises(ImportFailed, match="holds no numbers; variable name holds"):
        load(tmp_path, {"name": "x"})
