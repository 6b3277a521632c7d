"""Cells of text tables as numbers: decimal signs, thousands, units behind the number.

What `1,234` or `1.234` means depends on the whole file. Where nothing in it tells, the column is
not taken: a factor of a thousand is worse than a column that is missing.
"""

import re
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .units import is_unit

_SPACES = " '\u2019\u00a0\u202f\u2009"
_WORDS = "- -- --- n/a na #n/a null none nan -nan nan(ind) -nan(ind)"
_OF_MSVC = "1.#qnan -1.#qnan 1.#snan 1.#ind -1.#ind 1.#inf -1.#inf"
_MISSING = frozenset(["", *_WORDS.split(), *_OF_MSVC.split()])
_WHOLE = r"[-+]?\d+"
_INFINITE = r"[-+]?inf(?:inity)?"


def _plain(decimal: str) -> str:
    sign = re.escape(decimal)
    return rf"[-+]?(?:\d+{sign}?\d*|{sign}\d+)(?:[eEdD][-+]?\d+)?"


def _grouped(decimal: str) -> str:
    other = "." if decimal == "," else ","
    sign = re.escape(decimal)
    group = rf"(?P<group>[{re.escape(other)}{_SPACES}])"
    return rf"[-+]?[1-9]\d{{0,2}}{group}\d{{3}}(?:(?P=group)\d{{3}})*(?:{sign}\d*)?"


_PLAIN = {decimal: re.compile(_plain(decimal)) for decimal in ".,"}
_GROUPED = {decimal: re.compile(_grouped(decimal)) for decimal in ".,"}
_WITH_UNIT = re.compile(r"(?P<number>.*?\d[.,]?)\s*(?P<unit>[^\W\d_]\S*|%|°\S*)")


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, with thousands or a unit perhaps."""
    match = _WITH_UNIT.fullmatch(cell)
    if match and is_unit(match["unit"]):
        cell = match["number"]
    cell = cell.replace("\u2212", "-").removeprefix('="').removesuffix('"')
    return bool(_PLAIN[decimal].fullmatch(cell) or _GROUPED[decimal].fullmatch(cell))


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    return cell.lower() in _MISSING


def shows_decimal(cell: str, decimal: str) -> bool:
    """Whether a cell proves that `decimal` is the decimal sign of its file."""
    return decimal in cell and is_number(cell, decimal) and not is_number(cell, ",.".strip(decimal))


@dataclass(frozen=True)
class Numbers:
    """A column of text as numbers; `lost` are the cells that hold something else."""

    values: NDArray[Any]
    lost: NDArray[np.bool_]
    unit: str | None
    note: str | None


def cleaned(column: Any) -> Any:
    """Cells as text without what only looks different; "" where a cell is empty or missing."""
    texts = column.fillna("").astype(str).str.strip()
    texts = texts.str.replace("\u2212", "-", regex=False)
    texts = texts.str.replace(r'^="(.*)"$', r"\1", regex=True)
    return texts.where(~texts.str.lower().isin(_MISSING), "")


def numbers_of(texts: Any, decimal: str, is_proved: bool) -> Numbers | str | None:
    """A cleaned column as numbers, if more than half of its cells are.

    None if it is something else, a text with the reason if its numbers cannot be told.
    `is_proved` says that something in the file proves the decimal sign.
    """
    if texts.str.lower().isin(["", "true", "false"]).all() and (texts != "").any():
        words = texts.str.lower().map({"true": 1.0, "false": 0.0, "": np.nan})
        return Numbers(words.to_numpy(np.float64), np.zeros(len(texts), bool), None, None)
    filled = texts != ""
    texts, unit = _without_unit(texts, filled)
    other = ",.".strip(decimal)
    plain = texts.str.fullmatch(_PLAIN[decimal].pattern)
    groups = texts.str.extract(rf"^{_GROUPED[decimal].pattern}$")["group"]
    apart = texts.str.fullmatch(_PLAIN[other].pattern) & ~plain & groups.isna()
    note = None
    if apart.any():
        decimal, note = other, f"{other!r} was read as its decimal sign"
        plain = texts.str.fullmatch(_PLAIN[decimal].pattern)
        groups = texts.str.extract(rf"^{_GROUPED[decimal].pattern}$")["group"]
    used = sorted(set(groups.dropna()))
    accepted = plain | groups.notna() | texts.str.fullmatch(f"(?i:{_INFINITE})")
    if 2 * int(accepted.sum()) <= int(filled.sum()):
        return None
    if used:
        first = texts[groups.notna()].iloc[0]
        if len(used) > 1 or (used == [other] and not (is_proved or _proves(texts, decimal))):
            return f"whether {first!r} has thousands or decimals, nothing in the file tells"
        note = f"{used[0]!r} was read as the sign between thousands, as in {first!r}"
        texts = texts.where(groups.isna(), texts.str.replace(used[0], "", regex=False))
    lost = (filled & ~accepted).to_numpy(bool)
    return Numbers(_parsed(texts, accepted.to_numpy(bool), decimal), lost, unit, note)


def _proves(texts: Any, decimal: str) -> bool:
    return any(shows_decimal(cell, decimal) for cell in texts)


def _without_unit(texts: Any, filled: Any) -> tuple[Any, str | None]:
    """Numbers without the one unit that stands behind them all."""
    first = _WITH_UNIT.fullmatch(next(iter(texts[filled]), ""))
    if first is None or not is_unit(first["unit"]):
        return texts, None
    parts = texts.str.extract(f"^{_WITH_UNIT.pattern}$")
    if not (parts["unit"] == first["unit"])[filled].all():
        return texts, None
    return parts["number"].fillna(""), first["unit"]


def _parsed(texts: Any, accepted: NDArray[np.bool_], decimal: str) -> NDArray[Any]:
    plain = texts.str.replace(decimal, ".", regex=False).str.replace("[dD]", "e", regex=True)
    cells = plain.to_numpy(dtype=str)
    if accepted.all() and plain.str.fullmatch(_WHOLE).all():
        with suppress(OverflowError):
            whole: NDArray[np.int64] = cells.astype(np.int64)
            return whole
    values = np.full(len(cells), np.nan)
    values[accepted] = cells[accepted].astype(np.float64)
    return values
