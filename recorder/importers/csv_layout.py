"""How a text table is laid out: separator, decimal sign, where its rows begin.

Everything is told from the file itself; what had to be decided is noted.
"""

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from seamlog.errors import ImportFailed

from .csv_cells import is_missing, is_number, shows_decimal
from .csv_header import headers_of, names_of
from .csv_text import one_line_cells
from .moments import is_moment

_LOOK = 200
"""Lines in front of the table that are looked at."""
_COMMENT = re.compile(r"\s*[#%]")


@dataclass
class Layout:
    """A table's layout; `body` are its rows, from line `first` (counted from 0) of the text on.

    `is_proved` says that a number of the table proves the decimal sign.
    """

    encoding: str
    separator: str
    decimal: str
    is_proved: bool
    first: int
    names: list[str]
    body: str = ""
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def layout_of(path: Path, text: str, encoding: str) -> Layout:
    """The layout of a table; `ImportFailed` if no rows of numbers are found."""
    text = one_line_cells(text)
    lines = [line.rstrip("\n") for line in islice(io.StringIO(text), _LOOK + 40)]
    separator, decimal = _separator(lines)
    look = _Look([split(line, separator) for line in lines], decimal)
    comments = {at for at, line in enumerate(lines) if _COMMENT.match(line)}
    table = look.table(comments)
    if not table:
        raise ImportFailed(
            f"{path} has no column of numbers: no row of numbers was found in its first "
            f"{len(lines)} lines; it must be a table with one row per moment"
        )
    first, width = table[0], max(len(look.rows[at]) for at in table)
    headers, top = headers_of(look.rows, first, width, look.is_numeric)
    look.check(path, table, top, separator)
    names, units, notes = names_of(headers, width)
    is_proved = any(shows_decimal(cell, decimal) for at in table for cell in look.rows[at])
    layout = Layout(encoding, separator, decimal, is_proved, first, names, units=units)
    above = sum(any(row) for row in look.rows[:top])
    if above:
        layout.notes.append(
            f"{above} line{'s' if above > 1 else ''} above the table were not imported"
        )
    layout.notes += notes
    layout.body = _body(text, lines[:first], layout.notes)
    return layout


def _body(text: str, above: Sequence[str], notes: list[str]) -> str:
    """The rows, without comments between them."""
    body = text[sum(len(line) + 1 for line in above) :]
    kept, count = re.subn(r"^[^\S\n]*[#%].*(?:\n|\Z)", "", body, flags=re.MULTILINE)
    if count:
        notes.append(f"{count} line{'s' if count > 1 else ''} of comment in the table")
    if kept and not kept.endswith("\n"):
        notes.append("the last line has no end: if the file was cut, its last value may be wrong")
    return kept


def split(line: str, separator: str) -> list[str]:
    """Cells of a line, without quotes and blanks around them."""
    line = line.lstrip("#%").replace("\r", " ")  # the csv module takes a lone one for a new line
    if separator == " ":
        return line.split()
    cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return [cell.strip() for cell in cells]


def _separator(lines: Sequence[str]) -> tuple[str, str]:
    """The separator with which most lines agree on a number of cells above one."""
    best, score = (",", "."), 0.0
    body = [line for line in lines if line.strip()][-60:]
    if not body:
        return best
    for separator in (";", "\t", ",", "|", " "):
        rows = [split(line, separator) for line in body]
        widths = [len(row) for row in rows]
        usual = max(set(widths), key=widths.count, default=0)
        if usual < 2 and separator != ",":
            continue
        for decimal in ".,":
            cells = [cell for row in rows if len(row) == usual for cell in row if cell]
            numeric = sum(_is_value(cell, decimal) for cell in cells)
            found = widths.count(usual) / len(body) * numeric / max(len(cells), 1)
            if found > score + 1e-9:
                best, score = (separator, decimal), found
    return best


def _is_value(cell: str, decimal: str) -> bool:
    return is_number(cell, decimal) or is_moment(cell)


@dataclass(frozen=True)
class _Look:
    """The first lines of a file as cells."""

    rows: Sequence[Sequence[str]]
    decimal: str

    def width(self, at: int) -> int:
        """Cells of a line up to the last one that is filled."""
        return max((place for place, cell in enumerate(self.rows[at], 1) if cell), default=0)

    def is_row(self, at: int) -> bool:
        """Whether half of the filled cells of a line are numbers."""
        filled = [cell for cell in self.rows[at] if cell]
        numbers = sum(_is_value(cell, self.decimal) for cell in filled)
        return bool(filled) and numbers > 0 and numbers * 2 >= len(filled)

    def is_numeric(self, cells: Sequence[str]) -> bool:
        """Whether a line holds nothing but numbers, two at least."""
        filled = [cell for cell in cells if not is_missing(cell)]
        return len(filled) > 1 and all(_is_value(cell, self.decimal) for cell in filled)

    def table(self, comments: set[int]) -> list[int]:
        """The lines of the longest run of rows; comments and blank lines do not end a run."""
        best: list[int] = []
        run: list[int] = []
        for at, row in enumerate(self.rows):
            if at in comments or not any(row):
                continue
            same = not run or (len(row) > 1) == (len(self.rows[run[0]]) > 1)
            if self.is_row(at) and same:
                run.append(at)
                best = max(best, run, key=len)
            else:
                run = [at] if self.is_row(at) else []
        return self._begun(best, comments) if best else []

    def _begun(self, table: list[int], comments: set[int]) -> list[int]:
        """Without lines above it that have numbers by chance, with rows that have more words."""
        usual = Counter(map(self.width, table)).most_common(1)[0][0]
        leading = self._leading(table, usual)
        while len(table) > 1 and not self._leads(table[0], leading):
            table = table[1:]
        while (
            len(table) > 1
            and self.width(table[0]) != usual
            and not self.is_numeric(self.rows[table[0]])
        ):
            table = table[1:]
        for at in reversed(range(table[0])):
            if at in comments:
                continue
            if self.width(at) != usual or not self._leads(at, leading):
                break
            table = [at, *table]
        return table

    def _leading(self, table: list[int], width: int) -> int:
        """The first column that holds numbers in most rows."""
        for place in range(width):
            if 2 * sum(self._leads(at, place) for at in table) > len(table):
                return place
        return 0

    def _leads(self, at: int, place: int) -> bool:
        return place < len(self.rows[at]) and _is_value(self.rows[at][place], self.decimal)

    def check(self, path: Path, table: list[int], top: int, separator: str) -> None:
        """Refuse what may be two tables, or cells that a comma within a number has split."""
        widths = Counter(map(self.width, table))
        usual = widths.most_common(1)[0][0]
        above = [at for at in range(top) if self.is_numeric(self.rows[at])]
        same = [at for at in above if self.width(at) == usual]
        if usual > 1 and len(same) > 2:
            raise ImportFailed(
                f"{path}: lines {same[0] + 1} to {same[-1] + 1} hold rows of the same width as the "
                f"table from line {table[0] + 1} on; split the file into one table each"
            )
        filled = [at for at in range(table[0]) if any(self.rows[at])]
        named = self.width(filled[-1]) if filled else 0
        most = named if named > 1 else min(widths)  # without a header nothing tells which is right
        odd = next((at for at in table if self.width(at) > most > 1), None)
        cells = len(self.rows[odd]) if odd is not None else 0
        shorter = (at for at in table if self.width(at) <= most and len(self.rows[at]) < cells)
        narrow = next(shorter, None)
        if odd is not None and narrow is not None:
            raise ImportFailed(
                f"{path}: line {odd + 1} has {self.width(odd)} cells, line {narrow + 1} has "
                f"{self.width(narrow)}, the line above {named}: commas seem to separate thousands "
                "or decimals as well as cells; export it with another separator, or correct it"
            )
        if separator == "," and named > 1 and usual in (2 * named - 1, 2 * named):
            raise ImportFailed(
                f"{path}: its rows have {usual} cells where the header has {named}: commas seem to "
                "separate decimals as well as cells; export it with another separator"
            )
