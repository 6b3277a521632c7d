"""What a report is made of: typed blocks that sections return and the page renders.

The same objects are dumped as the JSON twin. Arrays stand in `curves.Column`; the twin holds their
key in the data block of the page, where `seamlog.reports.encode` puts them.
"""

from typing import Annotated, Literal

from pydantic import Field, computed_field

from seamlog.results import Criterion, Figure, Severity, Verdict

from .block import Block
from .curves import Column, CurvePlot, Histogram, SeamPlot, TimePlot


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
    reasons: list["FindingLine"] = Field(default_factory=list)
    statements: list[Statement] = Field(default_factory=list)


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


class Track(Block):
    """Where on a picture the places of a domain lie: left and right toe.

    In pixels of the photo, `width_px` x `height_px`, of which the picture may be a reduced copy.
    """

    domain: str
    width_px: int
    height_px: int
    x: Column
    left_x_px: Column
    left_y_px: Column
    right_x_px: Column
    right_y_px: Column


class PictureMark(Block):
    """A line across the bead that is drawn in the picture, from toe to toe and a little beyond."""

    label: str
    x1_px: float
    y1_px: float
    x2_px: float
    y2_px: float


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
    marks: list[PictureMark] = Field(default_factory=list)


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


class Moment(Block):
    """A place as photo and camera saw it; both follow the cursor.

    `frame` is the camera picture of that moment, `frames` the block that holds all of them.
    """

    kind: Literal["moment"] = "moment"
    id: str
    place: PlaceLink | None = None
    photo: PictureBlock | None = None
    frame: Frame | None = None
    frames: Frames | None = Field(None, exclude=True, repr=False)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def frames_id(self) -> str | None:
        """Where the other pictures of the camera are."""
        return self.frames.id if self.frames else None


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
    | CurvePlot
    | Histogram
    | PictureBlock
    | Frames
    | Moment,
    Field(discriminator="kind"),
]


class Section(Block):
    """A chapter of the report; `name` is its anchor."""

    name: str
    title: str
    blocks: list[AnyBlock]
