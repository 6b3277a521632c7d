"""Topics as Parquet and CSV tables."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from seamlog.files import replacing
from seamlog.mcap.columns import Columns
from seamlog.session import Session

from .parts import as_text, iter_parts, units_of

_DANGEROUS = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet would take for a formula at the beginning of a text."""


def write_parquet(session: Session, topic: str, path: Path, force: bool) -> int:
    """One topic as a Parquet file, units in the metadata of its columns; number of rows."""
    units = units_of(session, topic)
    metadata = {f"seamlog.{k}": v for k, v in session.channel_metadata(topic).items()}
    count, writer = 0, None
    with replacing(path, force) as partial:
        try:
            for columns in iter_parts(session, topic):
                known = writer.schema if writer else None
                table = _table(columns, units, {"topic": topic, **metadata}, known)
                if writer is None:
                    writer = pq.ParquetWriter(partial, table.schema, compression="zstd")
                writer.write_table(table)
                count += table.num_rows
        finally:
            if writer is not None:
                writer.close()
    return count


def _table(
    columns: Columns, units: dict[str, str], metadata: dict[str, str], known: pa.Schema | None
) -> pa.Table:
    """`known` is the schema of an earlier part."""
    if known is not None:
        arrays = [_array(column, known.field(name).type) for name, column in columns.items()]
        return pa.table(arrays, schema=known)
    arrays = [_array(column, None) for column in columns.values()]
    fields = [
        pa.field(name, array.type, metadata={"unit": units[name]} if name in units else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    return pa.table(arrays, schema=pa.schema(fields, metadata=metadata))


def _array(column: NDArray[Any], known: pa.DataType | None) -> pa.Array:
    """Values of mixed kinds, which no type of Arrow holds, become text."""
    if column.ndim == 2:
        flat = pa.array(np.ascontiguousarray(column).reshape(-1))
        return pa.FixedSizeListArray.from_arrays(flat, column.shape[1])
    if column.dtype != object:
        return pa.array(column)
    kind = known or _type_of(column)
    if kind != pa.string():
        try:
            return pa.array(list(column), kind)
        except (pa.ArrowInvalid, pa.ArrowTypeError):
            if known is not None:
                return pa.array([[as_text(item) for item in value] for value in column], known)
    return pa.array([as_text(value) for value in column], pa.string())


def _type_of(column: NDArray[Any]) -> pa.DataType:
    """Arrow type of a column of objects, by the first that tells something."""
    told = (value for value in column if isinstance(value, np.ndarray | bytes | str) or value)
    value = next(told, [""] if any(isinstance(value, list) for value in column) else "")
    if isinstance(value, np.ndarray) and value.ndim == 1:
        return pa.list_(pa.from_numpy_dtype(value.dtype))
    if isinstance(value, bytes):
        return pa.binary()
    if isinstance(value, list) and isinstance(value[0], str):
        return pa.list_(pa.string())
    return pa.string()


def write_csv(session: Session, topic: str, path: Path, force: bool) -> int:
    """One topic as a CSV file; number of rows.

    Elements of fixed arrays are columns, other sequences JSON. A text that a spreadsheet would take
    for a formula gets an apostrophe in front.
    """
    count = 0
    with replacing(path, force) as partial, partial.open("wb") as file:
        writer = None
        for columns in iter_parts(session, topic):
            table = pa.table(dict(_cells(columns)))
            if writer is None:
                options = pyarrow.csv.WriteOptions(quoting_style="needed")
                writer = pyarrow.csv.CSVWriter(file, table.schema, write_options=options)
            writer.write_table(table)
            count += table.num_rows
        if writer is not None:
            writer.close()
    return count


def _cells(columns: Columns) -> Iterator[tuple[str, pa.Array]]:
    for name, column in columns.items():
        if column.ndim == 2:
            for place in range(column.shape[1]):
                yield f"{name}[{place}]", pa.array(np.ascontiguousarray(column[:, place]))
        elif column.dtype == object:
            yield name, pa.array([_guarded(as_text(value)) for value in column], pa.string())
        elif column.dtype.kind == "b":
            yield name, pa.array(column.astype(np.int8))
        else:
            yield name, pa.array(column)


def _guarded(text: str) -> str:
    return f"'{text}" if text.startswith(_DANGEROUS) else text
