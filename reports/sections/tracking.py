"""How well the table followed its reference."""

from collections.abc import Sequence

from seamlog.reports.content import AnyBlock
from seamlog.reports.parts import each_part, part_blocks
from seamlog.reports.run import Run


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Error, reference and measurement, command, speed."""
    return each_part(runs, "tracking", part_blocks)
