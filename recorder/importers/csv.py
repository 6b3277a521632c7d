"""Text tables as loggers, scopes and spreadsheets write them."""

import io
import re
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ImportFailed

from .content import Content
from .csv_cells import Numbers, cleaned, numbers_of
from .csv_layout import Layout, layout_of
from .csv_text import decode
from .moments import DAY_NS, Moments, moments_of, past_midnight
from .units import is_unit

_TOO_WIDE = re.compile(r"Expected (\d+) fields in line (\d+), saw (\d+)")


class CsvImporter:
    """Reads a text table; cells without a number are NaN, dates and times become ns since 1970.

    Any separator, decimal comma, thousands, byte order marks, lines above and below the table, a
    second header line (units, or groups), tables side by side, a date and a time of day in two
    columns. Columns without a name are called by their place: `column 1`, `column 2` and so on.
    """

    def load(self, path: Path) -> Content:
        """All columns that hold numbers; `ImportFailed` if there is no table."""
        text, encoding, notes = decode(path)
        layout = layout_of(path, text, encoding)
        content = Content({}, notes=[*notes, *layout.notes])
        table = _rows_only(_read(path, layout), layout, content)
        reader = _Reader(layout, content)
        columns = {
            name: found
            for place, name in enumerate(layout.names)
            if (found := reader.column(table[place], name)) is not None
        }
        if not columns:
            raise ImportFailed(f"{path} has no column of numbers: {'; '.join(content.notes)}")
        empty = [name for place, name in enumerate(layout.names) if table[place].isna().all()]
        columns = _trimmed(columns, layout.names, empty, content)
        content.columns = reader.joined_dates(columns) | columns
        return content


def _read(path: Path, layout: Layout) -> Any:
    import warnings

    import pandas as pd

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(
                io.BytesIO(layout.body.encode()),
                sep=r"\s+" if layout.separator == " " else layout.separator,
                decimal=layout.decimal,
                header=None,
                names=range(len(layout.names)),
                index_col=False,
                skipinitialspace=True,
                skip_blank_lines=True,
                on_bad_lines="error",
                low_memory=False,
            )
    except pd.errors.ParserWarning as error:
        raise ImportFailed(
            f"{path}: rows have more cells than the {len(layout.names)} of the table"
        ) from error
    except (ValueError, pd.errors.ParserError) as error:
        match = _TOO_WIDE.search(str(error))
        if match is None:
            raise ImportFailed(f"{path} cannot be read as a table: {error}") from error
        raise ImportFailed(
            f"{path}: row {match[2]} of the table (line {int(match[2]) + layout.first} or later) "
            f"has {match[3]} cells where the table has {match[1]}: a second table, or a comma "
            "that separates decimals or thousands; correct the line or split the file"
        ) from error


def _rows_only(table: Any, layout: Layout, content: Content) -> Any:
    """The table without lines that are no rows: below it, repeated headers, remarks."""
    wrong = np.zeros(len(table), bool)
    right = np.zeros(len(table), bool)
    first_wrong = np.zeros(len(table), bool)
    seen = np.zeros(len(table), bool)
    for place in range(len(layout.names)):
        column = table[place]
        filled = column.notna().to_numpy()
        found = _numbers(column, layout)
        if isinstance(found, Numbers):
            wrong |= found.lost
            right |= filled & ~found.lost
            first_wrong |= found.lost & ~seen
        elif column.dtype != object and column.dtype != "str":
            right |= filled
        seen |= filled
    is_row = ~(wrong & (first_wrong | ~right))
    if is_row.all():
        return table
    end = int(np.flatnonzero(is_row)[-1]) + 1 if is_row.any() else 0
    if end < len(table):
        content.notes.append(f"{len(table) - end} lines below the table were not imported")
    inside = np.flatnonzero(~is_row[:end])
    headers = [at for at in inside if _is_header(table.iloc[at], layout)]
    if headers:
        content.notes.append(f"the header comes again {len(headers)} times within the table")
    others = [int(at) for at in inside if at not in headers]
    if others:
        content.losses.append(
            f"{len(others)} lines within the table are no rows, the first after row {others[0]}: "
            f"{' '.join(str(cell) for cell in table.iloc[others[0]].dropna())[:60]!r}"
        )
    return table[is_row].reset_index(drop=True)


def _is_header(row: Any, layout: Layout) -> bool:
    return any(str(cell).strip() == name for cell, name in zip(row, layout.names, strict=True))


def _numbers(column: Any, layout: Layout) -> Numbers | str | None:
    """Text as numbers; None where the column holds numbers already, or none."""
    import pandas as pd

    if pd.api.types.is_numeric_dtype(column):
        return None
    return numbers_of(cleaned(column), layout.decimal, layout.is_proved)


class _Reader:
    """Columns of cells as columns of numbers, and which of them are dates and times of day."""

    def __init__(self, layout: Layout, content: Content) -> None:
        self._layout, self._content = layout, content
        self._moments: dict[str, Moments] = {}
        self._names: list[str] = []

    def column(self, column: Any, name: str) -> NDArray[Any] | None:
        """Numbers, or ns; None for an empty column, or one of text."""
        import pandas as pd

        content = self._content
        self._names.append(name)
        if name in self._layout.units:
            content.units[name] = self._layout.units[name]
        if pd.api.types.is_bool_dtype(column):
            return np.asarray(column, np.float64)
        if pd.api.types.is_numeric_dtype(column):
            return None if column.isna().all() else np.asarray(column)
        found = _numbers(column, self._layout)
        if isinstance(found, Numbers):
            return self._told(found, column, name)
        moments = None if found else self._times(column, name)
        if isinstance(moments, Moments):
            content.notes += [f"column {name!r}: {note}" for note in moments.notes]
            content.units[name] = "ns"
            self._moments[name] = moments
            is_time = moments.kind == "time of day"
            return past_midnight(moments.ns) if is_time else moments.ns
        if self._is_unit_of_last(column):
            return None
        reason = found or moments
        content.notes.append(
            f"column {name!r}: {reason}; it was not imported"
            if reason
            else f"column {name!r} holds text and was not imported"
        )
        return None

    def _is_unit_of_last(self, column: Any) -> bool:
        """Whether a column holds but the unit of the one before it, which then has it."""
        cells = set(cleaned(column)) - {""}
        if len(cells) != 1 or not is_unit(unit := cells.pop()) or len(self._names) < 2:
            return False
        self._content.units.setdefault(self._names[-2], unit)
        return True

    def _told(self, found: Numbers, column: Any, name: str) -> NDArray[Any]:
        if found.unit:
            self._content.units.setdefault(name, found.unit)
        if found.note:
            self._content.notes.append(f"column {name!r}: {found.note}")
        lost = np.flatnonzero(found.lost)
        if len(lost):
            self._content.lost_cells[name] = (
                f"column {name!r}: {len(lost)} cells are no numbers and count as missing, the "
                f"first {str(column.iloc[lost[0]])[:30]!r} in row {lost[0] + 1}"
            )
        return found.values

    def _times(self, column: Any, name: str) -> Moments | str | None:
        texts = cleaned(column)
        if not len(texts) or (texts == "").all():
            return None
        found = moments_of(texts[texts != ""].reset_index(drop=True))
        if isinstance(found, Moments) and (texts == "").any():
            row = int(np.flatnonzero(texts == "")[0]) + 1
            return f"holds times, but none in row {row}"
        return found

    def joined_dates(self, columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """A column `Date Time` out of the one column of dates and the one of times of day."""
        kinds = {kind: [n for n, m in self._moments.items() if m.kind == kind] for kind in _KINDS}
        if any(len(names) != 1 for names in kinds.values()):
            return {}
        (date,), (time,) = kinds.values()
        days, clock = self._moments[date].ns, self._moments[time].ns
        if len(columns[date]) != len(columns[time]):
            return {}
        joined = days + clock
        if (np.diff(joined) < -DAY_NS // 2).any():
            joined = days[0] + past_midnight(clock)
        name = f"{date} {time}"
        self._content.units[name] = "ns"
        self._content.notes.append(f"columns {date!r} and {time!r} make column {name!r}")
        return {name: joined}


_KINDS = ("date", "time of day")


def _trimmed(
    columns: dict[str, NDArray[Any]], names: list[str], empty: list[str], content: Content
) -> dict[str, NDArray[Any]]:
    """Tables side by side may have different lengths: what is empty below a column goes."""
    ends = {}
    for name, column in columns.items():
        filled = np.flatnonzero(~np.isnan(column.astype(np.float64)))
        ends[name] = int(filled[-1]) + 1 if len(filled) else 0
    longest = max(ends.values())
    found: dict[str, NDArray[Any]] = {}
    for block in _blocks(names, empty):
        block = [name for name in block if name in columns]
        end = max((ends[name] for name in block), default=longest)
        if end < longest:
            content.notes.append(
                f"columns {block[0]!r} to {block[-1]!r} are a table of their own with {end} rows"
            )
        found |= {name: columns[name][:end] for name in block}
    return found


def _blocks(names: list[str], empty: list[str]) -> list[list[str]]:
    """Runs of columns, split at empty ones and where a name of the first run comes again."""
    blocks: list[list[str]] = []
    for is_gap, run in groupby(names, key=lambda name: name in empty):
        if is_gap:
            continue
        blocks.append([])
        for name in run:
            stem, _, number = name.rpartition(".")
            if blocks[-1] and stem and number.isdigit() and stem == blocks[0][0]:
                blocks.append([])
            blocks[-1].append(name)
    return blocks
