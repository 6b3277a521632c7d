"""The bead's surface: spatter, gaps, ends; cracks and pores as candidates with a picture."""

from collections.abc import Sequence

from seamlog.reports.content import AnyBlock
from seamlog.reports.parts import criteria, each_part, figures, findings, pictures, plots, tables
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Part


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Pictures with what was found, then the figures."""
    return each_part(runs, "surface", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    return [
        *pictures(run, part),
        statement(part),
        *findings(run, part),
        *figures(part),
        *criteria(run, part),
        *plots(run, part),
        *tables(run, part),
    ]
