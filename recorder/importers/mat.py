"""MATLAB files: up to version 7.2 through SciPy, version 7.3 (HDF5) through pymatreader."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import HardwareError, ImportFailed

from .content import Content

_HDF5 = b"MATLAB 7.3"
_MOST_RECORDS = 64
_WIDE = 4
"""A matrix this much wider than high holds its signals in rows."""


class MatImporter:
    """Reads the variables of a `.mat` file; fields of structures are named `variable.field`.

    Vectors become columns, single numbers scalars, the columns of a matrix `name[0]`, `name[1]`
    (its rows, where it is much wider than high), elements of structure arrays `name[0].field`.
    What holds no numbers is left out.
    """

    def load(self, path: Path) -> Content:
        """All numeric columns; `ImportFailed` if the file is no MATLAB file this can read."""
        with path.open("rb") as file:
            is_hdf5 = file.read(len(_HDF5)) == _HDF5
        try:
            content = _read_hdf5(path) if is_hdf5 else _read(path)
        except (FileNotFoundError, ImportFailed, HardwareError):
            raise
        except Exception as error:
            raise ImportFailed(f"{path} cannot be read as a MATLAB file: {error}") from error
        found = Content({}, notes=[])
        columns: dict[str, NDArray[Any]] = {}
        for name, value in content.items():
            if not name.startswith(("__", "#")):
                columns.update(_columns(name, value, found.notes))
        if not columns:
            raise ImportFailed(f"{path} holds no numbers")
        found.columns = columns
        return found


def _read(path: Path) -> Mapping[str, Any]:
    import scipy.io

    found: Mapping[str, Any] = scipy.io.loadmat(str(path), squeeze_me=False, struct_as_record=True)
    return found


def _read_hdf5(path: Path) -> Mapping[str, Any]:
    try:
        from pymatreader import read_mat
    except ImportError as error:
        raise HardwareError(
            f"{path}: MATLAB 7.3 files are read by pymatreader: pip install 'seamlog[import]'"
        ) from error
    found: Mapping[str, Any] = read_mat(str(path))
    return found


def _columns(name: str, value: Any, notes: list[str]) -> Iterator[tuple[str, NDArray[Any]]]:
    if isinstance(value, Mapping):
        for field, inner in value.items():
            yield from _columns(f"{name}.{field}", inner, notes)
        return
    if isinstance(value, bool | int | float):
        value = np.asarray(value)
    if not isinstance(value, np.ndarray):
        notes.append(f"variable {name} holds {type(value).__name__}, no numbers, and was left out")
    elif value.size == 0:
        notes.append(f"variable {name} is empty")
    elif value.dtype.names and value.size <= _MOST_RECORDS:
        for place, record in enumerate(value.reshape(-1)):
            label = name if value.size == 1 else f"{name}[{place}]"
            for field in value.dtype.names:
                yield from _columns(f"{label}.{field}", record[field], notes)
    elif value.dtype == object and value.size == 1:
        yield from _columns(name, value.reshape(-1)[0], notes)
    elif value.dtype.kind in "biuf" and value.ndim <= 2:
        yield from _numeric(name, value, notes)
    else:
        what = f"{value.dtype} of shape {value.shape}"
        notes.append(f"variable {name} holds {what} and was left out")


def _numeric(
    name: str, value: NDArray[Any], notes: list[str]
) -> Iterator[tuple[str, NDArray[Any]]]:
    if value.size == 1:
        yield name, value.reshape(())
    elif value.ndim == 1 or min(value.shape) == 1:
        yield name, value.reshape(-1)
    else:
        if value.shape[1] > _WIDE * value.shape[0]:
            notes.append(f"variable {name} is {value.shape[0]} rows: each was taken as a column")
            value = value.T
        for index in range(value.shape[1]):
            yield f"{name}[{index}]", value[:, index]
