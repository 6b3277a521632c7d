"""The builder: results in, sections in their order, one HTML file out.

report = Report("Weld 42")
report.add_results(Results.open(folder))
report.add_section("notes", "Notes", [Text(text="...")])
report.write(Path("report.html"))
"""

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path

from seamlog import __version__, plugins
from seamlog.files import write_bytes
from seamlog.results import Results

from .content import AnyBlock, Section
from .links import links_of
from .page import Document, has_uplot, render
from .parts import part_blocks
from .run import KINDS, Run, anchor, utc_date
from .verdicts import overall

SectionMaker = Callable[[Sequence[Run]], list[AnyBlock] | None]
"""A section plug-in: the runs to blocks, or None where it has nothing to say about them."""

TITLES = {"verdict": "Verdict", **KINDS, "record": "Inspection record", "provenance": "Provenance"}
"""Our own sections in the order of the page; those of others follow by name."""


class Report:
    """Collects results and sections; the same content always gives the same bytes."""

    def __init__(self, title: str | None = None, date: str | None = None) -> None:
        self._title = title
        self._date = date
        self._runs: list[Run] = []
        self._added: list[Section] = []

    def add_results(self, results: Results) -> None:
        """Take in one results directory; several stand side by side."""
        self._runs.append(Run(results, len(self._runs)))

    def add_section(self, name: str, title: str, blocks: list[AnyBlock]) -> None:
        """Put a section of your own behind all others."""
        self._added.append(Section(name=name, title=title, blocks=blocks))

    def document(self) -> Document:
        """The whole report as typed content."""
        subject = ", ".join(dict.fromkeys(run.label for run in self._runs))
        return Document(
            title=self._title or f"Weld report: {self._named() or subject}",
            subject=subject,
            id=self._id(),
            date=self._date or self._end(),
            verdict=overall(self._runs).verdict,
            seamlog_version=__version__,
            interactive=has_uplot(),
            sections=[*self._sections(), *self._added],
            links=[link for run in self._runs for link in links_of(run)],
        )

    def write(self, path: Path, force: bool = False) -> Document:
        """Write the report whole or not at all, and return what it says."""
        document = self.document()
        write_bytes(path, render(document).encode(), force)
        return document

    def _named(self) -> str:
        """What the sessions call their parts; '' unless each of them does."""
        names = [run.part_name for run in self._runs]
        return ", ".join(dict.fromkeys(name for name in names if name)) if all(names) else ""

    def _id(self) -> str:
        digest = hashlib.sha256(b"".join(run.fingerprint for run in self._runs))
        return digest.hexdigest()[:16]

    def _end(self) -> str | None:
        ends = [end for run in self._runs if (end := run.end_ns()) is not None]
        return utc_date(max(ends)) if ends else None

    def _sections(self) -> list[Section]:
        available = plugins.available("seamlog.sections")
        names = [name for name in TITLES if name in available]
        names += sorted(set(available) - set(TITLES))
        made = []
        for name in names:
            make: SectionMaker = plugins.load("seamlog.sections", name)
            if blocks := make(self._runs):
                title = TITLES.get(name, name.replace("_", " ").capitalize())
                made.append(Section(name=name, title=title, blocks=blocks))
        return made + self._unclaimed(set(available))

    def _unclaimed(self, claimed: set[str]) -> list[Section]:
        """Parts of kinds that no section knows, shown by the uniform rule."""
        kinds = dict.fromkeys(p.part for run in self._runs for p in run.parts)
        return [
            Section(
                name=anchor(kind),
                title=kind.replace("_", " ").capitalize(),
                blocks=[b for run in self._runs for p in run.of(kind) for b in part_blocks(run, p)],
            )
            for kind in kinds
            if kind not in claimed
        ]
