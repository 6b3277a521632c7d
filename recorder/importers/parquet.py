"""Parquet tables."""

from collections import Counter
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
            table = pq.ParquetFile(path).read()
            while any(pa.types.is_struct(field.type) for field in table.schema):
                table = table.flatten()
        except (pa.ArrowException, OSError) as error:
            raise ImportFailed(f"{path} cannot be read as a Parquet file: {error}") from error
        content = Content({}, notes=[])
        columns: dict[str, NDArray[Any]] = {}
        seen: Counter[str] = Counter()
        for field, column in zip(table.schema, table.columns, strict=True):
            seen[field.name] += 1
            name = field.name + (f".{seen[field.name]}" if seen[field.name] > 1 else "")
            if _add_elements(name, column, columns):
                continue
            values = _values(name, column, content)
            if values is None:
                content.notes.append(f"column {name!r} holds {field.type} and was left out")
                continue
            columns[name] = values
            unit = (field.metadata or {}).get(b"unit")
            if unit:
                content.units[name] = unit.decode(errors="replace")
        if not columns or not table.num_rows:
            raise ImportFailed(f"{path} has no column of numbers")
        content.columns = columns
        return content


def _add_elements(name: str, column: Any, columns: dict[str, NDArray[Any]]) -> bool:
    """Add the columns `name[0]`, `name[1]` of arrays of one length; False for others."""
    import pyarrow as pa

    if not pa.types.is_fixed_size_list(column.type) or column.null_count:
        return False
    kind = column.type.value_type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return False
    flat = np.asarray(column.combine_chunks().flatten().to_numpy())
    for place, values in enumerate(flat.reshape(-1, column.type.list_size).T):
        columns[f"{name}[{place}]"] = np.ascontiguousarray(values)
    return True


def _values(name: str, column: Any, content: Content) -> NDArray[Any] | None:
    import pyarrow as pa

    kind = column.type
    if pa.types.is_temporal(kind) and column.null_count:
        row = column.is_null().to_pylist().index(True) + 1
        content.notes.append(f"column {name!r} holds times, but none in row {row}")
        return None
    if pa.types.is_time(kind):
        content.notes.append(f"column {name!r} holds times of day: ns since midnight")
        content.units[name] = "ns"
        return np.asarray(column.cast(pa.time64("ns")).cast(pa.int64()).to_numpy())
    if pa.types.is_date(kind):
        column = column.cast(pa.timestamp("s"))
        kind = column.type
    if pa.types.is_timestamp(kind):
        if kind.tz is None:
            content.notes.append(f"column {name!r} has no time zone and was taken as UTC")
        content.units[name] = "ns"
        return np.asarray(column.cast(pa.timestamp("ns"), safe=False).cast(pa.int64()).to_numpy())
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = column.type
    if pa.types.is_duration(kind):
        content.units[name] = "ns"
        return np.asarray(column.cast(pa.duration("ns"), safe=False).cast(pa.int64()).to_numpy())
    if pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
        kind = column.type
    if pa.types.is_boolean(kind):
        column = column.cast(pa.int8())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return None
    return np.asarray(column.to_numpy())
