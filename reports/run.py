"""One results directory as the report sees it: parts, tables, its time line and its places."""

import hashlib
import re
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.results import Finding, Part, Place, Results

from .content import FindingLine, PlaceLink
from .numbers import format_number

KINDS = {
    "bead": "Bead",
    "quality": "Quality",
    "surface": "Surface",
    "join": "Bead and log",
    "seam": "Seam and path",
    "tracking": "Tracking",
    "replay": "Replay",
    "identification": "Identification",
    "health": "Recording health",
}
"""Parts a whole analysis writes, in the order of the report, and what people call them."""

_LONGEST_ANCHOR = 80
_ON_BEAD = ("bead", "surface", "quality", "join")
"""Parts whose places are looked up on the bead."""
_ON_PHOTO = ("bead", "surface", "quality")
"""Parts whose arc length is that of the bead on its photo."""


class Run:
    """One results directory, read once; `index` counts the directories of the report."""

    def __init__(self, results: Results, index: int) -> None:
        self.results = results
        self.index = index
        self.parts = results.parts()
        self.fingerprint = results.fingerprint()
        self._columns: dict[tuple[str, str], dict[str, NDArray[Any]]] = {}
        self.label = self._label()
        self.origin_ns = self._origin_ns()

    def of(self, kind: str) -> list[Part]:
        """The parts of one kind, by index."""
        return sorted((p for p in self.parts if p.part == kind), key=lambda part: part.index)

    def columns(self, part: Part, table: str) -> dict[str, NDArray[Any]]:
        """A table of `part` as arrays by column name."""
        key = (part.stem, table)
        if key not in self._columns:
            self._columns[key] = self.results.columns(part, table)
        return self._columns[key]

    def seconds(self, stamp_ns: NDArray[Any]) -> NDArray[np.float64]:
        """Stamps as seconds on the run's time line, to the nearest microsecond; NaN stays."""
        known = np.isfinite(stamp_ns)
        seconds = np.full(stamp_ns.shape, np.nan)
        ticks = (stamp_ns[known].astype(np.int64) - self.origin_ns + 500) // 1000
        seconds[known] = ticks / 1e6
        return seconds

    def second(self, time_ns: int) -> float:
        """One time on the run's time line."""
        return float(self.seconds(np.array([time_ns], dtype=np.int64))[0])

    @property
    def time_domain(self) -> str:
        """Name of the axis that all time plots of this run share."""
        return f"{self.index}/time"

    def seam_domain(self, part: Part, weld: int | None = None) -> str:
        """Name of the axis along the seam of `part`'s weld; a photo has an axis of its own."""
        if part.part in _ON_PHOTO:
            return f"{self.index}/photo/{part.index}"
        return f"{self.index}/seam/{weld or part.weld or part.index}"

    def end_ns(self) -> int | None:
        """End of the weld or recording as the parts state it; None if none does."""
        stated = [part.details.get("end_ns") for part in self.parts]
        for part in self.parts:
            figure = part.figure("end_ns")
            stated.append(figure.value if figure else None)
        known = [int(value) for value in stated if isinstance(value, int | float)]
        return max(known, default=None)

    @property
    def part_name(self) -> str:
        """What the session says was welded; '' if it does not."""
        for part in self.parts:
            metadata = part.details.get("metadata")
            if isinstance(metadata, dict) and isinstance(metadata.get("part"), str):
                return str(metadata["part"])
        return ""

    def place(self, part: Part, place: Place | None) -> PlaceLink | None:
        """Where a finding of `part` is, as something to jump to."""
        if place is None or (place.s_mm is None and place.time_ns is None):
            return None
        words, seconds = [], None
        if place.s_mm is not None:
            where = " on the photo" if part.part in _ON_PHOTO else ""
            words.append(f"s = {format_number(place.s_mm, 1)} mm{where}")
        if place.time_ns is not None:
            seconds = self.second(place.time_ns)
            words.append(f"t = {format_number(seconds, 2)} s")
        domain, x = self.time_domain, seconds
        if place.s_mm is not None and (seconds is None or part.part in _ON_BEAD):
            domain, x = self.seam_domain(part, place.weld), place.s_mm
        section = "bead" if part.part == "join" else part.part
        return PlaceLink(text=", ".join(words), section=anchor(section), domain=domain, x=x)

    def lines(self, part: Part, findings: Iterable[Finding]) -> list[FindingLine]:
        """Findings of `part` with places to jump to."""
        return [
            FindingLine(severity=f.severity, message=f.message, place=self.place(part, f.place))
            for f in findings
        ]

    def _label(self) -> str:
        names = [entry.name for part in self.parts for entry in part.inputs]
        sessions = [name for name in names if name.endswith(".mcap")]
        return next(iter(sessions + names), f"results {self.index + 1}")

    def _origin_ns(self) -> int:
        """First stamp of any table: zero of the time line."""
        firsts = [
            int(np.nanmin(stamps))
            for part in self.parts
            for name, table in part.tables.items()
            if "stamp_ns" in table.columns and part.part != "join"
            if (stamps := self.columns(part, name)["stamp_ns"]).size and np.isfinite(stamps).any()
        ]
        return min(firsts, default=0)


def anchor(*names: str) -> str:
    """A name that can stand in an address; what cannot is replaced, and told apart by a hash."""
    raw = "-".join(names)
    plain = re.sub(r"[^A-Za-z0-9_]+", "-", raw).strip("-")[:_LONGEST_ANCHOR]
    if plain == re.sub(r"[ .]", "-", raw):
        return plain
    return f"{plain or 'x'}-{hashlib.sha256(raw.encode()).hexdigest()[:8]}"


def utc_date(time_ns: int) -> str:
    """The day of a log time, as 2026-01-31, in UTC."""
    return datetime.fromtimestamp(time_ns // 1_000_000_000, UTC).date().isoformat()
