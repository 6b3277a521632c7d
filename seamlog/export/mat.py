"""Topics as structures of a MATLAB file (version 5, as `load` of every MATLAB and Octave reads)."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import UsageError
from seamlog.files import replacing
from seamlog.session import Session

from .parts import units_of

_NAME = 63
_MOST_BYTES = 1 << 31


def write_mat(session: Session, topics: list[str], path: Path, force: bool) -> int:
    """One structure per topic (`/table/encoder` is `table_encoder`); number of rows in all.

    Sequences become cell arrays; units stand in the field `units`.
    """
    import scipy.io

    content: dict[str, Any] = {}
    rows = 0
    for topic in topics:
        columns = session.columns(topic)
        rows += len(columns["log_time_ns"])
        record = {_name(name): _value(column) for name, column in columns.items()}
        units = {_name(name): unit for name, unit in units_of(session, topic).items()}
        content[_unique(_name(topic), content)] = {**record, "units": units, "topic": topic}
        for name, column in record.items():
            if column.nbytes >= _MOST_BYTES:
                raise UsageError(
                    f"{topic} {name} has {column.nbytes} bytes, more than a MATLAB 5 file holds; "
                    "export a shorter range with --from and --to, or to Parquet"
                )
    with replacing(path, force) as partial:
        scipy.io.savemat(
            str(partial), content, appendmat=False, long_field_names=True, oned_as="column"
        )
    return rows


def _name(text: str) -> str:
    name = re.sub(r"\W+", "_", text).strip("_")[:_NAME]
    return name if re.match(r"[A-Za-z]", name) else f"x_{name}"[:_NAME]


def _unique(name: str, taken: dict[str, Any]) -> str:
    number, found = 1, name
    while found in taken:
        number += 1
        found = f"{name[: _NAME - 4]}_{number}"
    return found


def _value(column: NDArray[Any]) -> NDArray[Any]:
    if column.dtype != object:
        return column
    cells = np.empty(len(column), object)
    for place, value in enumerate(column):
        cells[place] = _cell(value)
    return cells


def _cell(value: Any) -> Any:
    if isinstance(value, bytes):
        return np.frombuffer(value, np.uint8)
    if not isinstance(value, list):
        return "" if value is None else value
    cells = np.empty(len(value), object)
    for place, item in enumerate(value):
        cells[place] = _cell(item)
    return cells
