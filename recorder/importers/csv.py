"""Text tables with a header line: comma, semicolon or tab between columns."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from seamlog.errors import ImportFailed


class CsvImporter:
    """Reads a `.csv` file; columns are named by the header line, cells without a number are NaN."""

    def load(self, path: Path) -> Mapping[str, NDArray[Any]]:
        """All columns that hold numbers; `ImportFailed` if there is no table."""
        import pandas as pd

        with path.open(encoding="utf-8", errors="replace") as file:
            header = file.readline()
        try:
            table = pd.read_csv(path, sep=_separator(header), skipinitialspace=True)
        except (ValueError, pd.errors.ParserError) as error:
            raise ImportFailed(f"{path} cannot be read as a table: {error}") from error
        numbers = table.apply(pd.to_numeric, errors="coerce")
        columns = {str(name).strip(): numbers[name].to_numpy() for name in numbers}
        found = {name: column for name, column in columns.items() if (column == column).any()}
        if not found or len(table) == 0:
            raise ImportFailed(
                f"{path} has no column of numbers below a header line; put the names of the "
                "columns into its first line"
            )
        return found


def _separator(header: str) -> str:
    """The separator that the header line has most of."""
    return max(",;\t", key=header.count)
