"""MATLAB files up to version 7.2."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ImportFailed


class MatImporter:
    """Reads the variables of a `.mat` file; fields of structures are named `variable.field`.

    Vectors become columns, single numbers scalars, the columns of a matrix `name[0]`, `name[1]`.
    What holds no numbers is left out.
    """

    def load(self, path: Path) -> Mapping[str, NDArray[Any]]:
        """All numeric columns; `ImportFailed` if the file is no MATLAB file this can read."""
        import scipy.io

        try:
            content = scipy.io.loadmat(str(path), squeeze_me=False, struct_as_record=True)
        except NotImplementedError as error:
            raise ImportFailed(
                f"{path} is a MATLAB 7.3 file (HDF5), which is not read; save it in MATLAB with "
                "save('name.mat', '-v7')"
            ) from error
        except FileNotFoundError:
            raise
        except Exception as error:
            raise ImportFailed(f"{path} cannot be read as a MATLAB file: {error}") from error
        columns: dict[str, NDArray[Any]] = {}
        for name, value in content.items():
            if not name.startswith("__"):
                columns.update(_columns(name, value))
        return columns


def _columns(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if not isinstance(value, np.ndarray) or value.size == 0:
        return
    if value.dtype.names and value.size == 1:
        record = value.reshape(-1)[0]
        for field in value.dtype.names:
            yield from _columns(f"{name}.{field}", record[field])
    elif value.dtype.kind in "biuf" and value.ndim <= 2:
        yield from _numeric(name, value)


def _numeric(name: str, value: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    if value.size == 1:
        yield name, value.reshape(())
    elif value.ndim == 1 or min(value.shape) == 1:
        yield name, value.reshape(-1)
    else:
        for index in range(value.shape[1]):
            yield f"{name}[{index}]", value[:, index]
