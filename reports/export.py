"""The numbers of a report for other programs: figures and tables as CSV or Parquet, in a folder."""

import csv
import io
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

from seamlog.files import write_bytes
from seamlog.results import Part

from .numbers import COVERAGE
from .run import Run, anchor

TableFormat = Literal["csv", "parquet"]

_FIGURES = ("results", "part", "index", "kind", "name", "label", "value", "unit", "U_k2", "lower")
_HEADER = (*_FIGURES, "upper", "verdict", "s_mm", "time_ns", "reason")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What makes a spreadsheet take a text for a formula."""


def export_tables(runs: Sequence[Run], folder: Path, table_format: TableFormat) -> list[str]:
    """Write `figures.csv` and every table into `folder`; returns the names of the files."""
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / "figures.csv", _text([_HEADER, *_rows(runs)]))
    names = ["figures.csv"]
    for run in runs:
        prefix = f"{run.index + 1}." if len(runs) > 1 else ""
        for part in run.parts:
            for table in part.tables:
                stem = prefix + anchor(part.stem.replace(".", "_"), table)
                names.append(_export(run, part, table, folder / stem, table_format))
    return names


def _rows(runs: Sequence[Run]) -> Iterator[Sequence[Any]]:
    for run in runs:
        for part in run.parts:
            head = (run.label, part.part, part.index)
            for figure in part.figures:
                expanded = None if figure.u is None else COVERAGE * figure.u
                told = (figure.name, figure.label, figure.value, figure.unit, expanded)
                yield (*head, "figure", *told, None, None, None, None, None, figure.reason)
            for item in part.criteria:
                expanded = None if item.u is None else COVERAGE * item.u
                place = (item.place.s_mm, item.place.time_ns) if item.place else (None, None)
                told = (item.name, item.label, item.value, item.unit, expanded)
                limits = (item.lower, item.upper, item.verdict.value)
                yield (*head, "limit", *told, *limits, *place, item.reason)


def _export(run: Run, part: Part, table: str, path: Path, table_format: TableFormat) -> str:
    target = path.with_name(f"{path.name}.{table_format}")
    if table_format == "parquet":
        shutil.copyfile(run.results.folder / part.tables[table].file, target)
        return target.name
    columns, units = run.columns(part, table), part.tables[table].columns
    header = [f"{name} [{units[name]}]" if units.get(name) else name for name in columns]
    cells = zip(*(column.tolist() for column in columns.values()), strict=True)
    write_bytes(target, _text([header, *cells]))
    return target.name


def _text(rows: Sequence[Sequence[Any]]) -> bytes:
    """RFC 4180, UTF-8; empty where there is no value."""
    out = io.StringIO()
    csv.writer(out).writerows([_cell(value) for value in row] for row in rows)
    return out.getvalue().encode()


def _cell(value: Any) -> Any:
    if value is None or value != value:
        return ""
    if isinstance(value, str) and value.startswith(_FORMULA):
        return f"'{value}"
    return value
