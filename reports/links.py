"""What ties the axes of a run together: photo, seam and time, as far as the results know it."""

from collections.abc import Sequence

import numpy as np

from seamlog.results import Part

from .curves import Column, Link
from .run import Run

_STATIONS = "stations"


def links_of(run: Run) -> list[Link]:
    """Seam to time by tables that hold both, the join before the log alone; photo to seam."""
    links = [
        _to_time(run, part, name)
        for part in sorted(run.parts, key=lambda part: part.part != "join")
        for name, table in part.tables.items()
        if {"s_mm", "stamp_ns"} <= set(table.columns)
    ]
    return [*links, *(link for part in run.of("join") for link in _to_seam(run, part))]


def everywhere(links: Sequence[Link], domain: str, x: float) -> dict[str, float]:
    """The place `x` of `domain` in every domain that links reach from there (as cursor.js)."""
    at = {domain: x}
    for _ in range(2):
        for link in links:
            ways = (
                (link.source, link.target, link.source_x.values, link.target_x.values),
                (link.target, link.source, link.target_x.values, link.source_x.values),
            )
            for source, target, source_x, target_x in ways:
                if source not in at or target in at or source_x.size < 2:
                    continue
                if source_x[0] <= at[source] <= source_x[-1]:
                    at[target] = float(np.interp(at[source], source_x, target_x))
    return at


def _to_time(run: Run, part: Part, table: str) -> Link:
    """The tie of one table: places whose time is known, both ascending."""
    columns = run.columns(part, table)
    s_mm, seconds = columns["s_mm"], run.seconds(columns["stamp_ns"])
    order = np.argsort(s_mm, kind="stable")
    order = order[np.isfinite(s_mm[order]) & np.isfinite(seconds[order])]
    latest = np.maximum.accumulate(np.concatenate(([-np.inf], seconds[order])))[:-1]
    order = order[seconds[order] > latest]
    return Link(
        source=run.seam_domain(part),
        target=run.time_domain,
        source_x=Column(values=s_mm[order]),
        target_x=Column(values=seconds[order]),
    )


def _to_seam(run: Run, join: Part) -> list[Link]:
    """The photo that was joined: its arc length less `offset_mm` is that of the torch.

    Without a stated offset, or without a join, nothing ties the photo to the log.
    """
    offset = join.details.get("offset_mm")
    beads = [bead for bead in run.of("bead") if "s_mm" in _columns(bead)]
    beads = [bead for bead in beads if bead.weld == join.weld]
    if not isinstance(offset, int | float) or not beads or _STATIONS not in join.tables:
        return []
    s_mm = run.columns(beads[0], _STATIONS)["s_mm"]
    ends = np.array([np.nanmin(s_mm), np.nanmax(s_mm)])
    return [
        Link(
            source=run.seam_domain(beads[0]),
            target=run.seam_domain(join),
            source_x=Column(values=ends),
            target_x=Column(values=ends - offset),
        )
    ]


def _columns(part: Part) -> dict[str, str]:
    return part.tables[_STATIONS].columns if _STATIONS in part.tables else {}
