"""What the axis is made of: inertia and friction with uncertainty, and how the estimates came."""

from collections.abc import Sequence

from seamlog.reports.content import AnyBlock
from seamlog.reports.parts import criteria, each_part, figures, findings, pictures, plots
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Part


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Parameters first, then the estimator's traces and the residual."""
    return each_part(runs, "identification", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    return [
        statement(part),
        *figures(part),
        *findings(run, part),
        *plots(run, part),
        *pictures(run, part),
        *criteria(run, part),
    ]
