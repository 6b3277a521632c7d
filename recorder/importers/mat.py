"""MATLAB files: up to version 7.2 through SciPy, version 7.3 (HDF5) through pymatreader."""

import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import HardwareError, ImportFailed

from .content import Content

_HDF5 = (b"MATLAB 7.3", b"\x89HDF\r\n")
_TRIAL = "import sys, scipy.io; scipy.io.loadmat(sys.argv[1])"
_MOST_RECORDS = 64
_MOST_DENSE = 10_000_000
_SHORTEST_SIGNAL = 8
"""Shorter vectors are parameters and tell nothing about the length of signals."""
_OBJECT = (
    "is an object of MATLAB (table, timetable, datetime, string...), which only MATLAB reads, and "
    "was left out; save numbers: table2struct(T, 'ToScalar', true), posixtime(t)"
)


class MatImporter:
    """Reads the variables of a `.mat` file; fields of structures are named `variable.field`.

    Vectors become columns, single numbers scalars, the columns of a matrix `name[0]`, `name[1]`
    (its rows, where these are as long as the file's vectors, or as there are fewer of them),
    elements of cells `name[0]`, of structure arrays `name[0].field`, parts of complex numbers
    `name.real` and `name.imag`. What holds no numbers is left out.
    """

    def load(self, path: Path) -> Content:
        """All numeric columns; `ImportFailed` if the file is no MATLAB file this can read."""
        with path.open("rb") as file:
            is_hdf5 = file.read(16).startswith(_HDF5)
        content = Content({}, notes=[])
        try:
            variables = _read_hdf5(path, content.notes) if is_hdf5 else _read(path)
        except (FileNotFoundError, ImportFailed, HardwareError):
            raise
        except Exception as error:
            raise ImportFailed(f"{path} cannot be read as a MATLAB file: {error}") from error
        arrays: dict[str, NDArray[Any]] = {}
        for name, value in variables.items():
            if not name.startswith(("__", "#")):
                arrays.update(_arrays(name, value, content.notes))
        lengths = {a.size for a in arrays.values() if a.ndim == 1 and a.size >= _SHORTEST_SIGNAL}
        columns: dict[str, NDArray[Any]] = {}
        for name, value in arrays.items():
            columns.update(_columns(name, value, lengths, content.notes))
        if not columns:
            raise ImportFailed("; ".join([f"{path} holds no numbers", *content.notes]))
        content.columns = columns
        return content


def _read(path: Path) -> Mapping[str, Any]:
    import scipy.io

    _try_apart(path)
    found: Mapping[str, Any] = scipy.io.loadmat(str(path), squeeze_me=False, struct_as_record=True)
    return found


def _try_apart(path: Path) -> None:
    """Read in a process of its own first: SciPy's C code dies of some damaged files."""
    tried = subprocess.run(
        [sys.executable, "-c", _TRIAL, str(path)], capture_output=True, check=False
    )
    if tried.returncode < 0:
        raise ImportFailed(
            f"{path} is damaged: SciPy's reader of MATLAB files dies of it (signal "
            f"{-tried.returncode}); save the data again, or as CSV"
        )


def _read_hdf5(path: Path, notes: list[str]) -> Mapping[str, Any]:
    import warnings

    try:
        from pymatreader import read_mat
    except ImportError as error:
        raise HardwareError(
            f"{path}: MATLAB 7.3 files are read by pymatreader: pip install 'seamlog[import]'"
        ) from error
    objects = _objects_of_hdf5(path)
    notes += [f"variable {name} {_OBJECT}" for name in objects]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about those objects
        found: dict[str, Any] = read_mat(str(path))
    for name in objects:
        _remove(found, name.split("."))
    return found


def _objects_of_hdf5(path: Path) -> list[str]:
    """Dotted names of what HDF5 holds only a reference to an object of."""
    import h5py

    found: list[str] = []

    def look(name: str, item: Any) -> None:
        if "MATLAB_object_decode" in item.attrs and not name.startswith("#"):
            found.append(name.replace("/", "."))

    with h5py.File(path) as file:
        file.visititems(look)
    return found


def _remove(tree: Any, path: list[str]) -> None:
    for name in path[:-1]:
        tree = tree.get(name) if isinstance(tree, dict) else None
    if isinstance(tree, dict):
        tree.pop(path[-1], None)


def _arrays(name: str, value: Any, notes: list[str]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Numeric arrays with what they are called, structures and cells taken apart."""
    from scipy.io.matlab import MatlabFunction, MatlabOpaque
    from scipy.sparse import issparse

    sparse: Any = value if issparse(value) else None
    if sparse is not None and np.prod(sparse.shape) <= _MOST_DENSE:
        value = sparse.toarray()
    if isinstance(value, Mapping):
        for field, inner in value.items():
            yield from _arrays(f"{name}.{field}", inner, notes)
        return
    if isinstance(value, list) and len(value) <= _MOST_RECORDS:
        for place, item in enumerate(value):
            yield from _arrays(f"{name}[{place}]", item, notes)
        return
    if isinstance(value, bool | int | float | complex):
        value = np.asarray(value)
    if isinstance(value, MatlabOpaque | MatlabFunction):
        notes.append(f"variable {name} {_OBJECT}")
    elif not isinstance(value, np.ndarray):
        notes.append(f"variable {name} holds {type(value).__name__}, no numbers, and was left out")
    elif value.size == 0:
        notes.append(f"variable {name} is empty")
    elif value.dtype.names and value.size <= _MOST_RECORDS:
        for place, record in enumerate(value.reshape(-1)):
            label = name if value.size == 1 else f"{name}[{place}]"
            for field in value.dtype.names:
                yield from _arrays(f"{label}.{field}", record[field], notes)
    elif value.dtype == object and value.size <= _MOST_RECORDS:
        for place, item in enumerate(value.reshape(-1)):
            yield from _arrays(name if value.size == 1 else f"{name}[{place}]", item, notes)
    elif value.dtype.kind == "c":
        yield from _arrays(f"{name}.real", value.real, notes)
        yield from _arrays(f"{name}.imag", value.imag, notes)
    elif value.dtype.kind in "biuf" and np.squeeze(value).ndim <= 2:
        yield name, np.squeeze(value)
    else:
        what = f"{value.dtype} of shape {value.shape}"
        notes.append(f"variable {name} holds {what} and was left out")


def _columns(
    name: str, value: NDArray[Any], lengths: set[int], notes: list[str]
) -> Iterator[tuple[str, NDArray[Any]]]:
    """A vector as it is, a matrix by its columns or rows; `lengths` are those of the vectors."""
    if value.ndim < 2:
        yield name, value
        return
    rows, width = value.shape
    in_rows = width in lengths and rows not in lengths
    if in_rows or (rows not in lengths and width > rows):
        notes.append(f"variable {name} is {rows} rows: each was taken as a column")
        value = value.T
    for index in range(value.shape[1]):
        yield f"{name}[{index}]", value[:, index]
