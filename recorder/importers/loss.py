"""What an import took over, what it left, and what of the values is doubtful."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.evenness import Evenness

from .column_map import FREE

_LONGEST_TABLE_M = 20.0


@dataclass
class Loss:
    """What an import took over and what it left: names by topic, counts of missing values."""

    rows: int
    not_imported: list[str]
    absent: dict[str, list[str]] = field(default_factory=dict)
    missing_values: dict[str, int] = field(default_factory=dict)
    timing: dict[str, Evenness] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)

    def tell(self, topic: str, name: str, values: NDArray[Any]) -> None:
        """Note what a field lacks and what is odd about it."""
        missing = int(np.isnan(values.astype(np.float64)).sum())
        if missing:
            self.missing_values[f"{topic} {name}"] = missing
        span = _span_m(topic, name, values)
        if span > _LONGEST_TABLE_M:
            self.notes.append(f"{topic} {name} spans {span:.4g} m: is its unit right?")
        digits = _rounded(values)
        if digits:
            self.notes.append(f"{topic} {name} has {digits} significant digits")


def _span_m(topic: str, name: str, values: NDArray[Any]) -> float:
    """How far a position of the table goes; 0 for everything else."""
    if topic.startswith(FREE) or name != "position_m" or np.isnan(values).all():
        return 0.0
    return float(np.nanmax(values) - np.nanmin(values))


def _rounded(values: NDArray[Any]) -> int | None:
    """Significant digits of values that are rounded to four or fewer; None for others."""
    found = (
        np.unique(values[np.isfinite(values) & (values != 0)]) if values.ndim == 1 else values[:0]
    )
    if len(found) < 50:
        return None
    scale = 10.0 ** np.floor(np.log10(np.abs(found)))
    for digits in (2, 3, 4):
        step = 10.0 ** (digits - 1)
        if np.allclose(np.rint(found / scale * step) / step * scale, found, rtol=1e-9, atol=0):
            return digits
    return None
