"""Parquet tables."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ImportFailed

from .content import Content


class ParquetImporter:
    """Reads the numeric columns of a `.parquet` file; time stamps become ns since 1970.

    Fields of structures are named `column.field`. A unit is taken over from the field's metadata.
    """

    def load(self, path: Path) -> Content:
        """All numeric columns; `ImportFailed` if the file is no Parquet file."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            table = pq.read_table(path)
            while any(pa.types.is_struct(field.type) for field in table.schema):
                table = table.flatten()
        except (pa.ArrowException, OSError) as error:
            raise ImportFailed(f"{path} cannot be read as a Parquet file: {error}") from error
        content = Content({}, notes=[])
        columns = {}
        for field, column in zip(table.schema, table.columns, strict=True):
            values = _values(field.name, column, content)
            if values is None:
                content.notes.append(f"column {field.name!r} holds {field.type} and was left out")
                continue
            columns[field.name] = values
            unit = (field.metadata or {}).get(b"unit")
            if unit:
                content.units[field.name] = unit.decode(errors="replace")
        if not columns or not table.num_rows:
            raise ImportFailed(f"{path} has no column of numbers")
        content.columns = columns
        return content


def _values(name: str, column: Any, content: Content) -> NDArray[Any] | None:
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind):
        if kind.tz is None:
            content.notes.append(f"column {name!r} has no time zone and was taken as UTC")
        if column.null_count:
            return None
        content.units[name] = "ns"
        return np.asarray(column.cast(pa.timestamp("ns"), safe=False).cast(pa.int64()).to_numpy())
    if pa.types.is_boolean(kind):
        column = column.cast(pa.int8())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return None
    return np.asarray(column.to_numpy())
