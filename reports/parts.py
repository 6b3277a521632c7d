"""A part of the results as blocks, the same way for every kind."""

import math
from collections.abc import Callable, Collection, Sequence
from typing import Any

from seamlog.results import Figure, Part

from .content import AnyBlock, CriterionTable, FigureTable, Findings, Heading, Notice, Table
from .pictures import frame_blocks, picture_block
from .plots import axis_of, plots_of, split_unit
from .run import KINDS, Run
from .verdicts import statement

_MOST_ROWS = 100

PartMaker = Callable[[Run, Part], Sequence[AnyBlock]]


def each_part(runs: Sequence[Run], kind: str, make: PartMaker) -> list[AnyBlock]:
    """The blocks of every part of one kind; a run without it is named, never left out silently."""
    blocks: list[AnyBlock] = []
    for run in runs:
        parts = run.of(kind)
        if len(runs) > 1 and parts:
            blocks.append(Heading(text=run.label))
        for part in parts:
            if len(parts) > 1:
                blocks.append(Heading(text=part.title))
            blocks += make(run, part)
    without = [run.label for run in runs if not run.of(kind)]
    if without:
        blocks.append(_missing(kind, without if len(without) < len(runs) else []))
    return blocks


def _missing(kind: str, labels: Sequence[str]) -> Notice:
    """What stands where a part is not in the results; `labels` name them if others hold it."""
    name = KINDS.get(kind, kind)
    whose = f" of {', '.join(labels)}" if labels else ""
    return Notice(text=f"{name}: not recorded", reason=f"The results{whose} hold no such part.")


def part_blocks(run: Run, part: Part) -> list[AnyBlock]:
    """Everything a part holds, by the uniform rule."""
    return [
        statement(part),
        *findings(run, part),
        *plots(run, part),
        *pictures(run, part),
        *figures(part),
        *criteria(run, part),
        *tables(run, part),
    ]


def figures(part: Part, leave_out: Collection[str] = ()) -> list[AnyBlock]:
    """The table of figures, if there are any."""
    kept = [figure for figure in part.figures if figure.name not in leave_out]
    return [FigureTable(caption=f"{part.title}: figures", figures=kept)] if kept else []


def criteria(run: Run, part: Part) -> list[AnyBlock]:
    """The table of limits, if any were given."""
    if not part.criteria:
        return []
    places = [run.place(part, criterion.place) for criterion in part.criteria]
    caption = f"{part.title}: limits"
    return [CriterionTable(caption=caption, criteria=part.criteria, places=places)]


def findings(run: Run, part: Part) -> list[AnyBlock]:
    """The findings, if there are any."""
    if not part.findings:
        return []
    lines = run.lines(part, part.findings)
    return [Findings(caption=f"{part.title}: findings", findings=lines)]


def plots(run: Run, part: Part, leave_out: Collection[str] = ()) -> list[AnyBlock]:
    """All plots of the tables that are not left out."""
    return [
        plot for name in part.tables if name not in leave_out for plot in plots_of(run, part, name)
    ]


def tables(run: Run, part: Part, leave_out: Collection[str] = ()) -> list[AnyBlock]:
    """Tables that run along neither time nor seam, as text."""
    return [
        _as_text(run, part, name)
        for name in part.tables
        if name not in leave_out and axis_of(run, part, name) is None
    ]


def _as_text(run: Run, part: Part, name: str) -> Table:
    """The first column names the rows; long tables are cut, and say so."""
    columns, units = run.columns(part, name), part.tables[name].columns
    first, *others = columns
    count = part.tables[name].rows
    cut = f", first {_MOST_ROWS} of {count} rows" if count > _MOST_ROWS else ""
    rows = [
        (str(columns[first][row]), [_cell(other, columns[other][row], units) for other in others])
        for row in range(min(count, _MOST_ROWS))
    ]
    header = [split_unit(column)[0] for column in columns]
    caption = f"{part.title}: {name.replace('_', ' ')}{cut}"
    return Table(caption=caption, header=header, rows=rows)


def _cell(name: str, value: Any, units: dict[str, str]) -> Figure | None:
    plain = value.item() if hasattr(value, "item") else value
    if plain is None or (isinstance(plain, float) and not math.isfinite(plain)):
        return None
    shown = str(plain) if isinstance(plain, bool) else plain
    return Figure(name=name, label=name, value=shown, unit=units.get(name, ""))


def pictures(run: Run, part: Part, leave_out: Collection[str] = ()) -> list[AnyBlock]:
    """All pictures that are not left out; those with a time as one block."""
    still = [name for name, picture in part.pictures.items() if picture.time_ns is None]
    shown = [picture_block(run, part, name) for name in still if name not in leave_out]
    return [*frame_blocks(run, part), *shown]
