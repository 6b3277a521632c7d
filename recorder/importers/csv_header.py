"""Header lines of text tables: names, groups, and the units in and below them."""

import re
from collections.abc import Callable, Sequence

from .units import is_unit

_HEADERS = 3
_RULE = re.compile(r"[-=+:|\s]*")
_IN_NAME = re.compile(r"^(?P<name>.*?)\s*(?P<mark>[\[(])(?P<unit>[^\[\]()]*)[\])]\s*$")
_AT_END = re.compile(r"^(?P<name>.+?)(?:\s*[/,]\s*| in )(?P<unit>[^\s/,]+(?:/[^\s/,]+)?)$")


def headers_of(
    rows: Sequence[Sequence[str]], first: int, width: int, is_numeric: Callable[..., bool]
) -> tuple[list[list[str]], int]:
    """Header lines in front of the first row (one may be blank), and the line where they begin."""
    found: list[list[str]] = []
    at = first - 1 if first > 1 and not any(rows[first - 1]) and any(rows[first - 2]) else first
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
        if is_numeric(cells):
            break
        if found and not _are_units(found[0]) and any(cell.isdigit() for cell in cells):
            break
        found.insert(0, [*cells, *[""] * (width - len(cells))][:width])
        at -= 1
    if len(found) == _HEADERS and not any(map(_are_units, found[1:])):
        at += 1
        del found[0]
    return found, at


def names_of(headers: list[list[str]], width: int) -> tuple[list[str], dict[str, str], list[str]]:
    """Names of the columns, units of those that state one, and notes."""
    names: list[str] = []
    found: dict[str, str] = {}
    notes: list[str] = []
    units = [""] * width
    with_units = next((at for at, cells in enumerate(headers[1:], 1) if _are_units(cells)), None)
    if with_units is not None:
        units = [cell.strip("[]() ") for cell in headers[with_units]]
        del headers[with_units]
        if len(headers) == 2 and with_units == 1:
            notes.append("a header line below the units was left out")
            del headers[1]
    if len(headers) == 2:
        headers[:] = [_joined(*headers)]
        notes.append("two header lines were joined into one name per column")
    if not headers:
        notes.append("no header line: columns are named by their place")
    cells = headers[0] if headers else [""] * width
    seen: dict[str, int] = {}
    for place, cell in enumerate(cells):
        name = cell or f"column {place + 1}"
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > 1:
            name = f"{name}.{seen[name]}"
        names.append(name)
        unit = units[place] or _unit_in(cell)
        if unit:
            found[name] = unit
    return names, found, notes


def _unit_in(name: str) -> str:
    """The unit in a name such as `Weg [mm]`, `Weg / mm` or `Weg in mm`.

    What stands in round brackets may as well be a remark.
    """
    match = _IN_NAME.match(name)
    if match:
        unit = match["unit"].strip()
        is_remark = match["mark"] == "(" and unit.isalpha() and not is_unit(unit)
        return "" if is_remark else unit
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
