"""How a text table is laid out: encoding, separator, decimal sign, header lines, units.

Everything is told from the file itself; what had to be decided is noted.
"""

import codecs
import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from seamlog.errors import ImportFailed

from .csv_cells import is_missing, is_number, shows_decimal
from .moments import is_moment
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
_LONGEST_CELL = 50
"""Lines that a cell in quotes may have; a quote that stays open longer is a stray one."""
_HEADERS = 3
_COMMENT = re.compile(r"\s*[#%]")
_RULE = re.compile(r"[-=+:|\s]*")
_IN_NAME = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
_AT_END = re.compile(r"^(?P<name>.+?)(?:\s*[/,]\s*| in )(?P<unit>[^\s/,]+(?:/[^\s/,]+)?)$")


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


def decode(path: Path) -> tuple[str, str, list[str]]:
    """Text, encoding and notes of a file; `ImportFailed` if it is no text."""
    data = path.read_bytes()
    for mark, encoding in _BOMS:
        if data.startswith(mark):
            return _decoded(path, data, encoding), encoding, []
    notes = []
    whole = data.rstrip(b"\0")
    if data[1:2] != b"\0" and len(data) - len(whole) > 1:
        notes.append(f"{len(data) - len(whole)} empty bytes behind the text: it was cut off there")
        data = whole
    if b"\0" in data[:4096]:
        return _decoded(path, data, _without_mark(path, data)), "utf-16", notes
    try:
        return data.decode("utf-8"), "utf-8", notes
    except UnicodeDecodeError:
        notes.append("the text is not UTF-8 and was read as Windows-1252")
        return data.decode("cp1252", errors="replace"), "cp1252", notes


def _without_mark(path: Path, data: bytes) -> str:
    """UTF-16 without a byte order mark: every other byte of western text is 0."""
    head = data[:4096]
    for place, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        if head[place::2].count(0) > len(head) * 0.45 and not head[1 - place :: 2].count(0):
            return encoding
    raise ImportFailed(f"{path} holds binary data, not a text table")


def _decoded(path: Path, data: bytes, encoding: str) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise ImportFailed(f"{path} begins as {encoding} and is not: {error}") from error


def layout_of(path: Path, text: str, encoding: str) -> Layout:
    """The layout of a table; `ImportFailed` if no rows of numbers are found."""
    text = _one_line_cells(text)
    lines = [line.rstrip("\n") for line in islice(io.StringIO(text), _LOOK + 40)]
    separator, decimal = _separator(lines)
    rows = [split(line, separator) for line in lines]
    comments = [bool(_COMMENT.match(line)) for line in lines]
    first = _first_row(rows, comments, decimal)
    if first is None:
        raise ImportFailed(
            f"{path} has no column of numbers: no row of numbers was found in its first "
            f"{len(lines)} lines; it must be a table with one row per moment"
        )
    width = max(len(row) for row in rows[first : first + 20])
    is_proved = any(shows_decimal(cell, decimal) for row in rows[first:] for cell in row)
    layout = Layout(encoding, separator, decimal, is_proved, first, [])
    headers, top = _headers(rows, first, width, decimal)
    _check_above(path, rows[:top], width, decimal)
    above = sum(any(row) for row in rows[:top])
    if above:
        layout.notes.append(
            f"{above} line{'s' if above > 1 else ''} above the table were not imported"
        )
    _name(layout, headers, width)
    _check_width(path, rows[first - 1] if first else [], rows[first : first + 20], separator)
    layout.body = _body(text, lines[:first], layout.notes)
    return layout


def _one_line_cells(text: str) -> str:
    """Text whose lines are rows: line ends of any kind, none of them within a cell."""
    if "\n" not in text:
        text = text.replace("\r", "\n")
    text = text.replace("\r\n", "\n")
    if '"' not in text:
        return text
    found: list[str] = []
    held: list[str] = []
    is_open = False
    for line in text.split("\n"):
        held.append(line)
        is_open ^= line.count('"') % 2 == 1
        if not is_open:
            found.append(" ".join(held))
            held = []
        elif len(held) > _LONGEST_CELL:
            found, held, is_open = [*found, *held], [], False
    return "\n".join([*found, *held])


def _body(text: str, above: Sequence[str], notes: list[str]) -> str:
    """The rows, without comments between them."""
    body = text[sum(len(line) + 1 for line in above) :]
    kept, count = re.subn(r"^[^\S\n]*[#%].*(?:\n|\Z)", "", body, flags=re.MULTILINE)
    if count:
        notes.append(f"{count} line{'s' if count > 1 else ''} of comment in the table")
    if kept and not kept.endswith("\n"):
        notes.append("the last line has no end: if the file was cut, its last value may be wrong")
    return kept


def _check_above(path: Path, rows: Sequence[Sequence[str]], width: int, decimal: str) -> None:
    """Rows of numbers above the header would be lost: the file holds more than one table."""
    numbers = [at for at, row in enumerate(rows) if _is_numeric(row, decimal)]
    same = [at for at in numbers if len(rows[at]) == width]
    if width > 1 and len(same) > 2:
        raise ImportFailed(
            f"{path}: lines {same[0] + 1} to {same[-1] + 1} hold rows of the same width as the "
            f"table from line {len(rows) + 1} on; split the file into one table each"
        )
    if numbers and numbers[-1] == len(rows) - 1:
        raise ImportFailed(
            f"{path}: line {len(rows)} has {len(rows[-1])} cells, the next one {width}: commas "
            "seem to separate thousands or decimals as well as cells; export it with another "
            "separator, or correct the line"
        )


def _check_width(
    path: Path, header: Sequence[str], rows: Sequence[Sequence[str]], separator: str
) -> None:
    named = sum(bool(cell) for cell in header)
    width = max(sum(bool(cell) for cell in cells) for cells in rows)
    if separator == "," and named > 1 and width in (2 * named - 1, 2 * named):
        raise ImportFailed(
            f"{path}: its rows have {width} cells where the header has {named}: commas seem to "
            "separate decimals as well as cells; export it with another separator"
        )


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


def _is_row(cells: Sequence[str], decimal: str) -> bool:
    filled = [cell for cell in cells if cell]
    numbers = sum(_is_value(cell, decimal) for cell in filled)
    return bool(filled) and numbers > 0 and numbers * 2 >= len(filled)


def _is_numeric(cells: Sequence[str], decimal: str) -> bool:
    """Whether a line holds nothing but numbers, two at least."""
    filled = [cell for cell in cells if not is_missing(cell)]
    return len(filled) > 1 and all(_is_value(cell, decimal) for cell in filled)


def _first_row(rows: Sequence[Sequence[str]], comments: Sequence[bool], decimal: str) -> int | None:
    """Where the longest run of rows of one width begins; comments do not end a run."""
    best, run, width = (0, 0), 0, 0
    begun = 0
    for place, (row, is_comment) in enumerate(zip([*rows, []], [*comments, False], strict=True)):
        if is_comment:
            continue
        is_row = _is_row(row, decimal)
        if run and len(row) == width and is_row:
            run += 1
            continue
        best = max(best, (run, -begun))
        width, run, begun = len(row), int(is_row), place
    length, start = best
    return _extended(rows, comments, -start, length, decimal) if length else None


def _extended(
    rows: Sequence[Sequence[str]], comments: Sequence[bool], first: int, length: int, decimal: str
) -> int:
    """Lines in front that have a number where the table's first numbers stand are rows, too."""
    table, width = rows[first : first + length], len(rows[first])
    leading = next(
        (
            place
            for place in range(width)
            if 2 * sum(_is_value(row[place], decimal) for row in table if len(row) == width)
            > len(table)
        ),
        0,
    )
    for at in reversed(range(first)):
        if comments[at]:
            continue
        if len(rows[at]) != width or not _is_value(rows[at][leading], decimal):
            break
        first = at
    return first


def _is_value(cell: str, decimal: str) -> bool:
    return is_number(cell, decimal) or is_moment(cell)


def _headers(
    rows: Sequence[Sequence[str]], first: int, width: int, decimal: str
) -> tuple[list[list[str]], int]:
    """Header lines in front of the first row, and the line where they begin."""
    found: list[list[str]] = []
    at = first
    while at > 0 and len(found) < _HEADERS:
        cells = rows[at - 1]
        filled = [cell for cell in cells if cell]
        if filled and all(_RULE.fullmatch(cell) for cell in filled):
            at -= 1
            continue
        if not filled or (len(cells) != width and len(filled) < max(2, width - 1)):
            break
        if found and width > 1 and len(filled) < 2:
            break
        if _is_numeric(cells, decimal):
            break
        found.insert(0, [*cells, *[""] * (width - len(cells))][:width])
        at -= 1
    if len(found) == _HEADERS and not any(map(_are_units, found[1:])):
        at += 1
        del found[0]
    return found, at


def _name(layout: Layout, headers: list[list[str]], width: int) -> None:
    units = [""] * width
    with_units = next((at for at, cells in enumerate(headers[1:], 1) if _are_units(cells)), None)
    if with_units is not None:
        units = [cell.strip("[]() ") for cell in headers[with_units]]
        del headers[with_units]
        if len(headers) == 2 and with_units == 1:
            layout.notes.append("a header line below the units was left out")
            del headers[1]
    if len(headers) == 2:
        headers[:] = [_joined(*headers)]
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
        unit = units[place] or _unit_in(cell)
        if unit:
            layout.units[name] = unit


def _unit_in(name: str) -> str:
    """The unit in a name such as `Weg [mm]`, `Weg / mm` or `Weg in mm`."""
    match = _IN_NAME.match(name)
    if match:
        return match["unit"].strip()
    match = _AT_END.match(name)
    return match["unit"] if match and is_unit(match["unit"]) else ""


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
