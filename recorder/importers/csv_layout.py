"""How a text table is laid out: encoding, separator, decimal sign, header lines, units.

Everything is told from the file itself; what had to be decided is noted.
"""

import codecs
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from seamlog.errors import ImportFailed

from .units import is_unit

_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_LOOK = 200
"""Lines in front of the table that are looked at."""
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.I)
_COMMA_NUMBER = re.compile(r"[-+]?(\d+,?\d*|,\d+)([eE][-+]?\d+)?")
_MOMENT = re.compile(
    r"(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[./]\d{1,2}[./]\d{2,4})?[T ]?"
    r"(\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?)?\s*(Z|[-+]\d{2}:?\d{2}|[AP]M)?",
    re.I,
)
_IN_NAME = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")


@dataclass
class Layout:
    """A table's layout; `first` is the line of its first row, counted from 0."""

    encoding: str
    separator: str
    decimal: str
    first: int
    names: list[str]
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def decode(path: Path) -> tuple[str, str, list[str]]:
    """Text, encoding and notes of a file; `ImportFailed` if it is no text."""
    data = path.read_bytes()
    for mark, encoding in _BOMS:
        if data.startswith(mark):
            return _decoded(path, data, encoding), encoding, []
    if b"\0" in data[:4096]:
        raise ImportFailed(f"{path} holds binary data, not a text table")
    try:
        return data.decode("utf-8"), "utf-8", []
    except UnicodeDecodeError:
        note = "the text is not UTF-8 and was read as Windows-1252"
        return data.decode("cp1252", errors="replace"), "cp1252", [note]


def _decoded(path: Path, data: bytes, encoding: str) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise ImportFailed(f"{path} begins as {encoding} and is not: {error}") from error


def layout_of(path: Path, text: str, encoding: str) -> Layout:
    """The layout of a table; `ImportFailed` if no rows of numbers are found."""
    lines = [line.rstrip("\r\n") for line in islice(io.StringIO(text), _LOOK + 40)]
    separator, decimal = _separator(lines)
    rows = [split(line, separator) for line in lines]
    first = _first_row(rows, decimal)
    if first is None:
        raise ImportFailed(
            f"{path} has no column of numbers: no row of numbers was found in its first "
            f"{len(lines)} lines; it must be a table with one row per moment"
        )
    width = max(len(row) for row in rows[first : first + 20])
    layout = Layout(encoding, separator, decimal, first, [])
    headers, above = _headers(rows, first, width)
    if above:
        layout.notes.append(
            f"{above} line{'s' if above > 1 else ''} above the table were not imported"
        )
    _name(layout, headers, width)
    return layout


def split(line: str, separator: str) -> list[str]:
    """Cells of a line, without quotes and blanks around them."""
    import csv

    line = line.lstrip("#%").replace("\r", " ")  # the csv module takes a lone one for a new line
    if separator == " ":
        return line.split()
    cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return [cell.strip() for cell in cells]


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number."""
    found = _NUMBER.fullmatch(cell)
    return bool(found) or (decimal == "," and bool(_COMMA_NUMBER.fullmatch(cell)))


def is_moment(cell: str) -> bool:
    """Whether a cell is a date, a time of day, or both."""
    return (
        ":" in cell + "-"
        and bool(cell)
        and any(c in cell for c in ":-/.")
        and bool(_MOMENT.fullmatch(cell))
        and not _NUMBER.fullmatch(cell)
    )


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
        for decimal in (".", ",") if separator != "," else (".",):
            cells = [cell for row in rows if len(row) == usual for cell in row if cell]
            numeric = sum(is_number(cell, decimal) or is_moment(cell) for cell in cells)
            found = widths.count(usual) / len(body) * numeric / max(len(cells), 1)
            if found > score + 1e-9:
                best, score = (separator, decimal), found
    return best


def _is_row(cells: Sequence[str], decimal: str) -> bool:
    filled = [cell for cell in cells if cell]
    numbers = sum(is_number(cell, decimal) or is_moment(cell) for cell in filled)
    return bool(filled) and numbers > 0 and numbers * 2 >= len(filled)


def _first_row(rows: Sequence[Sequence[str]], decimal: str) -> int | None:
    """Where the longest run of rows of one width begins."""
    best, run, width = (0, 0), 0, 0
    for place, row in enumerate([*rows, []]):
        if len(row) == width and _is_row(row, decimal):
            run += 1
            continue
        best = max(best, (run, run - place))
        width, run = len(row), int(_is_row(row, decimal))
    length, start = best
    return -start if length else None


def _headers(rows: Sequence[Sequence[str]], first: int, width: int) -> tuple[list[list[str]], int]:
    """Up to two header lines in front of the first row, and how many lines stand above them."""
    found: list[list[str]] = []
    at = first
    while at > 0 and len(found) < 2:
        cells = rows[at - 1]
        filled = [cell for cell in cells if cell]
        if not filled or (len(cells) != width and len(filled) < max(2, width - 1)):
            break
        if found and width > 1 and len(filled) < 2:
            break
        found.insert(0, [*cells, *[""] * (width - len(cells))][:width])
        at -= 1
    above = sum(any(row) for row in rows[:at])
    return found, above


def _name(layout: Layout, headers: list[list[str]], width: int) -> None:
    units = [""] * width
    if len(headers) == 2 and _are_units(headers[1]):
        units = [cell.strip("[]() ") for cell in headers.pop()]
    elif len(headers) == 2:
        headers = [_joined(*headers)]
        layout.notes.append("two header lines were joined into one name per column")
    if not headers:
        layout.notes.append("no header line: columns are named by their place")
    cells = headers[0] if headers else [""] * width
    seen: dict[str, int] = {}
    for place, cell in enumerate(cells):
        name = cell or f"column {place + 1}"
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > 1:
            name = f"{name}.{seen[name]}"
        layout.names.append(name)
        match = _IN_NAME.match(cell)
        unit = units[place] or (match["unit"].strip() if match else "")
        if unit:
            layout.units[name] = unit


def _are_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell]
    marked = [
        cell for cell in filled if cell[0] in "[(" or is_unit(cell.strip("[]() ")) or cell in "-_"
    ]
    return bool(filled) and len(marked) * 2 > len(filled)


def _joined(groups: Sequence[str], names: Sequence[str]) -> list[str]:
    """`group name`; a group's name stands over its first column only."""
    found, group = [], ""
    for above, name in zip(groups, names, strict=True):
        group = above or group
        found.append(f"{group} {name}".strip())
    return found
