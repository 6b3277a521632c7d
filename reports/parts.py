"""A part of the results as blocks, the same way for every kind."""

from collections.abc import Callable, Collection, Sequence

from seamlog.results import Part

from .content import (
    AnyBlock,
    CriterionTable,
    FigureTable,
    Findings,
    Heading,
    Notice,
)
from .pictures import picture_block
from .plots import plots_of
from .run import KINDS, Run
from .verdicts import statement

PartMaker = Callable[[Run, Part], Sequence[AnyBlock]]


def each_part(runs: Sequence[Run], kind: str, make: PartMaker) -> list[AnyBlock]:
    """The blocks of every part of one kind; a run without it gets a notice, never silence."""
    blocks: list[AnyBlock] = []
    for run in runs:
        parts = run.of(kind)
        if len(runs) > 1:
            blocks.append(Heading(text=run.label))
        if not parts:
            blocks.append(missing(kind))
        for part in parts:
            if len(parts) > 1:
                blocks.append(Heading(text=part.title))
            blocks += make(run, part)
    return blocks


def missing(kind: str) -> Notice:
    """What stands where a part is not in the results."""
    name = KINDS.get(kind, kind)
    return Notice(text=f"{name}: not recorded", reason="The results hold no such part.")


def part_blocks(run: Run, part: Part) -> list[AnyBlock]:
    """Everything a part holds, by the uniform rule."""
    return [
        statement(part),
        *findings(run, part),
        *plots(run, part),
        *pictures(run, part),
        *figures(part),
        *criteria(run, part),
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


def pictures(run: Run, part: Part, leave_out: Collection[str] = ()) -> list[AnyBlock]:
    """All pictures that are not left out."""
    return [picture_block(run, part, name) for name in part.pictures if name not in leave_out]
