"""The seam as the camera saw it: pictures that follow the cursor, and the path found."""

from collections.abc import Sequence

from seamlog.reports.content import AnyBlock
from seamlog.reports.parts import (
    criteria,
    each_part,
    figures,
    findings,
    pictures,
    plots,
    tables,
)
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Part


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Pictures first, then what was found in them."""
    return each_part(runs, "seam", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    return [
        statement(part),
        *findings(run, part),
        *pictures(run, part),
        *figures(part),
        *criteria(run, part),
        *plots(run, part),
        *tables(run, part),
    ]
