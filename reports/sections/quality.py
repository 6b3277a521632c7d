"""Quality: limits of the drawing, rows of a standard, capability, each with its verdict."""

from collections.abc import Sequence

from seamlog.reports.content import AnyBlock
from seamlog.reports.parts import criteria, each_part, figures, findings, pictures, plots, tables
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Part


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Limits with their verdicts first, then capability."""
    return each_part(runs, "quality", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    return [
        statement(part),
        *criteria(run, part),
        *findings(run, part),
        *figures(part),
        *plots(run, part),
        *tables(run, part),
        *pictures(run, part),
    ]
