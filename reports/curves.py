"""Curves and what they are drawn with: columns, series, plots, histograms, ties of axes."""

import hashlib
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, computed_field

from .block import Block
from .encode import Encoded, encode
from .numbers import curve_decimals


class Column(Block):
    """One-dimensional numbers; NaN where there is no value."""

    values: NDArray[Any] = Field(exclude=True, repr=False)

    @computed_field  # type: ignore[prop-decorator]
    @cached_property
    def key(self) -> str:
        """Name in the data block: a hash of the values, so that equal columns are stored once."""
        plain = np.ascontiguousarray(self.values, dtype=np.float64)
        return "c" + hashlib.sha256(plain.tobytes()).hexdigest()[:16]

    @cached_property
    def coded(self) -> Encoded:
        """The values as they stand in the data block."""
        return encode(self.values)


class Series(Block):
    """One curve, with the band `low` to `high` around it where both are given."""

    label: str
    unit: str
    values: Column
    low: Column | None = None
    high: Column | None = None
    band_label: str = ""
    step: bool = False
    """Held until the next sample (a command), not joined by straight lines."""

    @computed_field  # type: ignore[prop-decorator]
    @property
    def decimals(self) -> int:
        """Decimals of a single point of the curve."""
        known = self.values.values[np.isfinite(self.values.values)]
        span = float(np.ptp(known)) if known.size else 0.0
        return curve_decimals(span, self._typical_expanded())

    def _typical_expanded(self) -> float | None:
        if self.low is None or self.high is None:
            return None
        halves = (self.high.values - self.low.values) / 2
        known = halves[np.isfinite(halves)]
        return float(np.median(known)) if known.size else None


class Limit(Block):
    """A horizontal line."""

    label: str
    value: float


class Mark(Block):
    """A place on the x axis that a finding names."""

    x: float
    label: str


class Plot(Block):
    """Curves over a common x; `domain` names the axis whose cursor and zoom it shares."""

    id: str
    title: str
    caption: str = ""
    domain: str
    x: Column
    x_label: str
    x_unit: str
    y_label: str
    series: list[Series]
    limits: list[Limit] = Field(default_factory=list)
    tolerance: tuple[float, float] | None = None
    """Lower and upper limit, where both are given: shaded between."""
    marks: list[Mark] = Field(default_factory=list)
    compact: bool = False
    """Drawn low, as one of several strips over the same x."""
    live: bool = True
    """False: its points are not in the file, only its drawing."""


class TimePlot(Plot):
    """Curves over seconds since the start of the results' time line."""

    kind: Literal["time_plot"] = "time_plot"


class SeamPlot(Plot):
    """Curves over the arc length along the seam."""

    kind: Literal["seam_plot"] = "seam_plot"


class CurvePlot(Plot):
    """Curves over a quantity of their own."""

    kind: Literal["curve_plot"] = "curve_plot"


class Histogram(Block):
    """How often values fall between the edges (one more edge than counts)."""

    kind: Literal["histogram"] = "histogram"
    id: str
    title: str
    x_label: str
    unit: str
    edges: list[float]
    counts: list[int]
    limits: list[Limit] = Field(default_factory=list)


class Link(Block):
    """How two domains are tied: the cursor at `source_x` of one is at `target_x` of the other."""

    source: str
    target: str
    source_x: Column
    target_x: Column
