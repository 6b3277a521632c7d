"""Text tables as loggers, scopes and spreadsheets write them."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ImportFailed

from .content import Content
from .csv_layout import Layout, decode, layout_of
from .moments import moments_ns


class CsvImporter:
    """Reads a text table; cells without a number are NaN, dates and times become ns since 1970.

    Any separator, decimal comma, byte order marks, lines above the header, a second header line
    (units, or groups), tables side by side. Columns without a name are called by their place:
    `column 1`, `column 2` and so on.
    """

    def load(self, path: Path) -> Content:
        """All columns that hold numbers; `ImportFailed` if there is no table."""
        text, encoding, notes = decode(path)
        layout = layout_of(path, text, encoding)
        table = _read(path, text, layout)
        content = Content({}, notes=[*notes, *layout.notes])
        columns: dict[str, NDArray[Any]] = {}
        for place, name in enumerate(layout.names):
            column = _numbers(table[place], name, content)
            if column is not None:
                columns[name] = column
                if name in layout.units:
                    content.units[name] = layout.units[name]
        if not columns:
            raise ImportFailed(f"{path} has no column of numbers")
        content.columns = _trimmed(columns, content)
        return content


def _read(path: Path, text: str, layout: Layout) -> Any:
    import pandas as pd

    try:
        return pd.read_csv(
            io.StringIO(text),
            sep=r"\s+" if layout.separator == " " else layout.separator,
            decimal=layout.decimal,
            skiprows=layout.first,
            header=None,
            names=range(len(layout.names)),
            index_col=False,
            skipinitialspace=True,
            skip_blank_lines=True,
            on_bad_lines="error",
            low_memory=False,
        )
    except (ValueError, pd.errors.ParserError) as error:
        raise ImportFailed(f"{path} cannot be read as a table: {error}") from error


def _numbers(column: Any, name: str, content: Content) -> NDArray[Any] | None:
    import pandas as pd

    if pd.api.types.is_bool_dtype(column):
        return np.asarray(column, np.float64)
    if pd.api.types.is_numeric_dtype(column):
        return None if column.isna().all() else np.asarray(column)
    numbers = pd.to_numeric(column.astype(str).str.strip(), errors="coerce")
    filled = column.notna() & (column.astype(str).str.strip() != "")
    lost = int((filled & numbers.isna()).sum())
    if numbers.notna().any() and lost * 2 < int(filled.sum()):
        if lost:
            content.notes.append(
                f"column {name!r}: {lost} cells are no numbers and count as missing"
            )
        return np.asarray(numbers, np.float64)
    moments: NDArray[Any] | None = moments_ns(column, name, content.notes)
    if moments is None:
        content.notes.append(f"column {name!r} holds text and was not imported")
        return None
    content.units[name] = "ns"
    return moments


def _trimmed(columns: dict[str, NDArray[Any]], content: Content) -> dict[str, NDArray[Any]]:
    """Tables side by side may have different lengths: what is empty below a column goes."""
    ends = {}
    for name, column in columns.items():
        filled = np.flatnonzero(~np.isnan(column.astype(np.float64)))
        ends[name] = int(filled[-1]) + 1 if len(filled) else 0
    longest = max(ends.values())
    names = list(columns)
    blocks = _blocks(names)
    found = {}
    for block in blocks:
        end = max(ends[name] for name in block)
        if end < longest:
            content.notes.append(
                f"columns {block[0]!r} to {block[-1]!r} are a table of their own with {end} rows"
            )
        for name in block:
            found[name] = columns[name][:end]
    return found


def _blocks(names: list[str]) -> list[list[str]]:
    """Runs of columns; a new one begins where a name of the first run comes again."""
    blocks: list[list[str]] = []
    for name in names:
        stem, _, number = name.rpartition(".")
        again = bool(stem) and number.isdigit() and bool(blocks) and stem == blocks[0][0]
        if not blocks or again:
            blocks.append([])
        blocks[-1].append(name)
    return blocks
