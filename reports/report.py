"""The builder: results in, sections in their order, one HTML file out.

report = Report("Weld 42")
report.add_results(Results.open(folder))
report.add_text("Notes", "The nozzle was changed before this weld.")
report.add_curves("Gas flow", seconds, {"flow": flow}, unit="l/min", limits={"least": 10})
report.write(Path("report.html"))
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike, NDArray

from seamlog import __version__, plugins
from seamlog.errors import UsageError
from seamlog.files import write_bytes
from seamlog.results import Figure, Results, Verdict, report_id

from .content import AnyBlock, FigureTable, Section, Text
from .document import Document
from .links import links_of
from .page import has_uplot
from .parts import part_blocks
from .pictures import picture_of_pixels
from .plots import make_curves
from .run import KINDS, Run, anchor, utc_date
from .size import fitted
from .verdicts import overall

SectionMaker = Callable[[Sequence[Run]], list[AnyBlock] | None]
"""A section plug-in: the runs to blocks, or None where it has nothing to say about them."""

TITLES = {"verdict": "Verdict", **KINDS, "record": "Inspection record", "provenance": "Provenance"}
"""Our own sections in the order of the page; those of others stand before the last ones."""
_LAST = ("record", "provenance")


LARGEST_BYTES = 25_000_000
"""Size beyond which a page is cut down: what mail servers still take."""


class Report:
    """Collects results and sections; the same content always gives the same bytes."""

    def __init__(
        self,
        title: str | None = None,
        date: str | None = None,
        largest_bytes: int = LARGEST_BYTES,
        sections: Sequence[str] | None = None,
    ) -> None:
        """`date` as 2026-01-31, None: the end of the weld. `sections`: plug-ins, None: all."""
        self._title = title
        self._date = date
        self._largest_bytes = largest_bytes
        self._chosen = sections
        self._verdict: Verdict | None = None
        self.runs: list[Run] = []
        self._added: list[Section] = []

    def add_results(self, results: Results) -> None:
        """Take in one results directory; several stand side by side."""
        self.runs.append(Run(results, len(self.runs)))

    def add_section(self, name: str, title: str, blocks: Sequence[AnyBlock]) -> None:
        """Put a section of your own behind all others; `name` is its anchor in the page."""
        names = {section.name for section in self._added} | set(TITLES)
        if anchor(name) in names:
            raise UsageError(
                f"the report has a section {anchor(name)!r} already; name it otherwise"
            )
        self._added.append(Section(name=anchor(name), title=title, blocks=list(blocks)))

    def add_text(self, title: str, *paragraphs: str) -> None:
        """A section of paragraphs."""
        self.add_section(self._free(title), title, [Text(text=text) for text in paragraphs])

    def add_figures(self, title: str, figures: Sequence[Figure]) -> None:
        """A section with a table of figures and their uncertainties."""
        blocks = [FigureTable(caption=title, figures=list(figures))]
        self.add_section(self._free(title), title, blocks)

    def add_curves(
        self,
        title: str,
        x: ArrayLike,
        curves: Mapping[str, ArrayLike],
        unit: str = "",
        x_label: str = "time",
        x_unit: str = "s",
        limits: Mapping[str, float] | None = None,
    ) -> None:
        """A section with one live plot of curves by name; `x` ascends, NaN is a gap."""
        name = self._free(title)
        plot = make_curves(name, title, x, curves, unit, x_label, x_unit, limits or {})
        self.add_section(name, title, [plot])

    def add_picture(self, title: str, image: NDArray[Any], caption: str = "") -> None:
        """A section with a picture, uint8, grey or BGR."""
        name = self._free(title)
        self.add_section(name, title, [picture_of_pixels(name, image, caption or title)])

    def judge(self, verdict: Verdict) -> None:
        """Set the verdict of the whole, where it does not come from the parts."""
        self._verdict = verdict

    def document(self) -> Document:
        """The whole report as typed content."""
        subject = ", ".join(dict.fromkeys(run.label for run in self.runs))
        return Document(
            title=self._title or f"Weld report: {self._named() or subject}",
            subject=subject,
            id=report_id(run.fingerprint for run in self.runs),
            date=self._date or self._end(),
            verdict=self._verdict or overall(self.runs).verdict,
            seamlog_version=__version__,
            interactive=has_uplot(),
            sections=self._ordered(),
            links=[] if self._chosen else [link for run in self.runs for link in links_of(run)],
        )

    def write(self, path: Path, force: bool = False) -> Document:
        """Write the report whole or not at all, and return what it says."""
        document, text = fitted(self.document(), self._largest_bytes)
        write_bytes(path, text.encode(), force)
        return document

    def _named(self) -> str:
        """What the sessions call their parts; '' unless each of them does."""
        names = [run.part_name for run in self.runs]
        return ", ".join(dict.fromkeys(name for name in names if name)) if all(names) else ""

    def _end(self) -> str | None:
        ends = [end for run in self.runs if (end := run.end_ns()) is not None]
        return utc_date(max(ends)) if ends else None

    def _free(self, title: str) -> str:
        """An anchor made of a title that nothing has yet."""
        taken = {section.name for section in self._added} | set(TITLES)
        wanted = anchor(title.lower().replace(" ", "-"))
        names = (wanted, *(f"{wanted}-{number}" for number in range(2, len(taken) + 3)))
        return next(name for name in names if name not in taken)

    def _ordered(self) -> list[Section]:
        """What was added last; first, where only some plug-ins were asked for."""
        made = self._sections()
        if self._chosen is None:
            return [*made, *self._added]
        return [*self._added, *made]

    def _sections(self) -> list[Section]:
        available = plugins.available("seamlog.sections")
        names = [name for name in TITLES if name in available and name not in _LAST]
        names += [*sorted(set(available) - set(TITLES)), *(n for n in _LAST if n in available)]
        if self._chosen is not None:
            names = [name for name in names if name in self._chosen]
        made = []
        for name in names:
            if name == _LAST[0] and self._chosen is None:
                made += self._unclaimed(set(available))
            make: SectionMaker = plugins.load("seamlog.sections", name)
            if blocks := make(self.runs):
                title = TITLES.get(name, name.replace("_", " ").capitalize())
                made.append(Section(name=name, title=title, blocks=blocks))
        return made

    def _unclaimed(self, claimed: set[str]) -> list[Section]:
        """Parts of kinds that no section knows, shown by the uniform rule."""
        kinds = dict.fromkeys(p.part for run in self.runs for p in run.parts)
        return [
            Section(
                name=anchor(kind),
                title=kind.replace("_", " ").capitalize(),
                blocks=[b for run in self.runs for p in run.of(kind) for b in part_blocks(run, p)],
            )
            for kind in kinds
            if kind not in claimed
        ]
