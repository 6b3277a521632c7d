"""What a report is made of: typed blocks that sections return and the page renders.

The same objects are dumped as the JSON twin. Arrays stand in `Column`; the twin holds their key
in the data block of the page, where `seamlog.reports.encode` puts them.
"""

import hashlib
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, computed_field

from seamlog.results import Criterion, Figure, Severity, Verdict

from .numbers import curve_decimals


class Block(BaseModel):
    """Something in a section, from top to bottom."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)


class Column(Block):
    """One-dimensional numbers; NaN where there is no value."""

    values: NDArray[Any] = Field(exclude=True, repr=False)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def key(self) -> str:
        """Name in the data block: a hash of the values, so that equal columns are stored once."""
        plain = np.ascontiguousarray(self.values, dtype=np.float64)
        return "c" + hashlib.sha256(plain.tobytes()).hexdigest()[:16]


class PlaceLink(Block):
    """A place a reader can jump to: cursor at `x` of `domain`, in the section `section`."""

    text: str
    section: str
    domain: str | None = None
    x: float | None = None


class Heading(Block):
    """A heading inside a section."""

    kind: Literal["heading"] = "heading"
    text: str


class Text(Block):
    """A paragraph."""

    kind: Literal["text"] = "text"
    text: str


class Notice(Block):
    """A remark set apart: what was not recorded or not assessed, and why."""

    kind: Literal["notice"] = "notice"
    text: str
    reason: str = ""


class Statement(Block):
    """The verdict on one part, with its reason."""

    kind: Literal["statement"] = "statement"
    subject: str
    verdict: Verdict
    reason: str = ""
    section: str
    missing: bool = False


class Banner(Block):
    """The overall verdict: its reasons with places, and what was not assessed."""

    kind: Literal["banner"] = "banner"
    verdict: Verdict
    summary: str
    reasons: list["FindingLine"] = []
    statements: list[Statement] = []


class KeyFigures(Block):
    """The few figures a reader looks for first."""

    kind: Literal["key_figures"] = "key_figures"
    figures: list[Figure]


class FigureTable(Block):
    """Figures with uncertainty; those without a value show their reason."""

    kind: Literal["figures"] = "figures"
    caption: str
    figures: list[Figure]


class CriterionTable(Block):
    """Limits somebody gave, and how the values stand to them."""

    kind: Literal["criteria"] = "criteria"
    caption: str
    criteria: list[Criterion]
    places: list[PlaceLink | None]


class FindingLine(Block):
    """One finding with the place it is at."""

    severity: Severity
    message: str
    place: PlaceLink | None = None


class Findings(Block):
    """Things a person should know."""

    kind: Literal["findings"] = "findings"
    caption: str
    findings: list[FindingLine]


class Fact(Block):
    """One row of a record; None reads 'not recorded'."""

    label: str
    value: str | None = None


class FactTable(Block):
    """A record: what is missing is shown as missing."""

    kind: Literal["facts"] = "facts"
    caption: str
    facts: list[Fact]


class Table(Block):
    """A table of figures, one row per named thing."""

    kind: Literal["table"] = "table"
    caption: str
    header: list[str]
    rows: list[tuple[str, list[Figure | None]]]


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
    limits: list[Limit] = []
    marks: list[Mark] = []
    compact: bool = False
    """Drawn low, as one of several strips over the same x."""


class TimePlot(Plot):
    """Curves over seconds since the start of the results' time line."""

    kind: Literal["time_plot"] = "time_plot"


class SeamPlot(Plot):
    """Curves over the arc length along the seam."""

    kind: Literal["seam_plot"] = "seam_plot"


class Histogram(Block):
    """How often values fall between the edges (one more edge than counts)."""

    kind: Literal["histogram"] = "histogram"
    id: str
    title: str
    x_label: str
    unit: str
    edges: list[float]
    counts: list[int]
    limits: list[Limit] = []


class Track(Block):
    """Where on a picture the places of a domain lie: left and right toe in its pixels."""

    domain: str
    x: Column
    left_x_px: Column
    left_y_px: Column
    right_x_px: Column
    right_y_px: Column


class PictureBlock(Block):
    """A picture; with a track the shared cursor moves on it and it moves the cursor."""

    kind: Literal["picture"] = "picture"
    id: str
    caption: str
    alt: str
    media_type: str
    width_px: int
    height_px: int
    sha256: str
    image: bytes = Field(exclude=True, repr=False)
    track: Track | None = None


class Frame(Block):
    """One picture of a camera, at `seconds` of the run's time line."""

    seconds: float
    media_type: str
    sha256: str
    image: bytes = Field(exclude=True, repr=False)


class Frames(Block):
    """Camera pictures of which the one at the cursor's time is shown; all of one size."""

    kind: Literal["frames"] = "frames"
    id: str
    title: str
    domain: str
    width_px: int
    height_px: int
    frames: list[Frame]


AnyBlock = Annotated[
    Heading
    | Text
    | Notice
    | Statement
    | Banner
    | KeyFigures
    | FigureTable
    | CriterionTable
    | Findings
    | FactTable
    | Table
    | TimePlot
    | SeamPlot
    | Histogram
    | PictureBlock
    | Frames,
    Field(discriminator="kind"),
]


class Section(Block):
    """A chapter of the report; `name` is its anchor."""

    name: str
    title: str
    blocks: list[AnyBlock]


class Link(Block):
    """How two domains are tied: the cursor at `source_x` of one is at `target_x` of the other."""

    source: str
    target: str
    source_x: Column
    target_x: Column
