"""Whether the recording is whole."""

from collections.abc import Sequence

from seamlog.reports.content import AnyBlock
from seamlog.reports.parts import each_part, part_blocks
from seamlog.reports.run import Run


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Drops, losses, gaps and clock of every channel."""
    return each_part(runs, "health", part_blocks)
