"""Text tables: comma, semicolon or tab between columns, a header line or none."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from seamlog.errors import ImportFailed


class CsvImporter:
    """Reads a `.csv` file; cells without a number are NaN.

    Columns are named by the header line; where the first line is numbers already, by their place:
    `column 1`, `column 2` and so on.
    """

    def load(self, path: Path) -> Mapping[str, NDArray[Any]]:
        """All columns that hold numbers; `ImportFailed` if there is no table."""
        import pandas as pd

        with path.open(encoding="utf-8", errors="replace") as file:
            header = file.readline()
        separator = _separator(header)
        named = not _all_numbers(header, separator)
        try:
            table = pd.read_csv(
                path, sep=separator, skipinitialspace=True, header=0 if named else None
            )
        except (ValueError, pd.errors.ParserError) as error:
            raise ImportFailed(f"{path} cannot be read as a table: {error}") from error
        if not named:
            table.columns = pd.Index([f"column {place + 1}" for place in range(table.shape[1])])
        numbers = table.apply(pd.to_numeric, errors="coerce")
        columns = {str(name).strip(): numbers[name].to_numpy() for name in numbers}
        found = {name: column for name, column in columns.items() if (column == column).any()}
        if not found or len(table) == 0:
            raise ImportFailed(
                f"{path} has no column of numbers; it must be a table with one row per moment, "
                "the names of its columns in the first line"
            )
        return found


def _separator(header: str) -> str:
    """The separator that the header line has most of."""
    return max(",;\t", key=header.count)


def _all_numbers(line: str, separator: str) -> bool:
    try:
        return all(float(cell) == float(cell) for cell in line.split(separator))
    except ValueError:
        return False
