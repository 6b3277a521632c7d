"""What an importer reads out of a foreign file, before a column map is applied."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray


@dataclass
class Content:
    """Columns (or scalars of shape ()) by their names in the file, and what the file says of them.

    `units` holds units that the file states, `times` the column that holds the time of another,
    `notes` what was left out or had to be decided while reading, `losses` what could not be read,
    `lost_cells` by column what of it could not be read.
    """

    columns: Mapping[str, NDArray[Any]]
    units: dict[str, str] = field(default_factory=dict)
    times: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    lost_cells: dict[str, str] = field(default_factory=dict)


@dataclass
class Report:
    """What the import of a whole file decided (`notes`) and what it could not take (`losses`)."""

    notes: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)

    @property
    def lines(self) -> list[str]:
        """All of it, losses first."""
        return [*self.losses, *self.notes]


def content_of(loaded: Any) -> Content:
    """What `load` gave: a `Content`, or columns alone."""
    return loaded if isinstance(loaded, Content) else Content(loaded)
