"""Bead and log joined: what the process and the table did at each millimetre of the bead."""

from collections.abc import Sequence

from seamlog.reports.content import AnyBlock, Text
from seamlog.reports.parts import criteria, each_part, figures, findings, pictures, plots, tables
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Part

_HOW = (
    "Each station of the bead is tied to the moment at which the torch was there. Move along any "
    "plot, the photo or the slider: everything else follows."
)


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Findings with their causes, then width, speed, error, command and heat along the seam."""
    return each_part(runs, "join", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    return [
        Text(text=_HOW),
        statement(part),
        *findings(run, part),
        *plots(run, part),
        *tables(run, part),
        *pictures(run, part),
        *figures(part),
        *criteria(run, part),
    ]
