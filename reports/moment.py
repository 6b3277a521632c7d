"""The place that matters most, as photo and camera saw it: for the first screen."""

from collections.abc import Sequence

import numpy as np

from seamlog.results import Part, Severity, Verdict

from .content import Frame, Frames, Moment, PictureBlock, PlaceLink
from .links import everywhere, links_of
from .pictures import frame_blocks, mark_on, picture_block, toe_track
from .run import Run, anchor

_OVERLAY, _STATIONS = "overlay", "stations"
_WIDEST_PX = 1000
_WIDTHS = (("s_mm", "width_mm"), ("s_px", "width_px"))


def moment_of(run: Run) -> Moment | None:
    """Photo and camera picture at the worst place; None where neither can be shown."""
    place = _worst(run) or _widest(run)
    at = {} if place is None or place.domain is None else _at(run, place)
    photo, frames = _photo(run, place, at), _frames(run)
    frame = _frame(run, frames, at)
    if photo is None and frame is None:
        return None
    return Moment(
        id=anchor("moment", str(run.index)),
        place=place,
        photo=photo,
        frame=frame,
        frames=frames,
    )


def _at(run: Run, place: PlaceLink) -> dict[str, float]:
    return everywhere(links_of(run), place.domain or "", place.x or 0.0)


def _worst(run: Run) -> PlaceLink | None:
    """Of what failed, else of what the findings name; the join before the bead before the rest."""
    ranked = sorted(
        run.parts,
        key=lambda part: ("join", "bead").index(part.part) if part.part in ("join", "bead") else 2,
    )
    failed = (
        run.place(part, criterion.place)
        for part in ranked
        for criterion in part.criteria
        if criterion.verdict is Verdict.FAIL
    )
    named = (
        run.place(part, finding.place)
        for part in ranked
        for finding in part.findings
        if finding.severity is not Severity.INFO
    )
    return next((place for place in (*named, *failed) if place is not None), None)


def _widest(run: Run) -> PlaceLink | None:
    """The widest trusted station of the first bead."""
    for part in run.of("bead")[:1]:
        if _STATIONS not in part.tables:
            continue
        columns = run.columns(part, _STATIONS)
        for axis, name in _WIDTHS:
            if axis not in columns or name not in columns:
                continue
            width = columns[name].astype(np.float64)
            if "flagged" in columns and columns["flagged"].dtype == np.bool_:
                width = np.where(columns["flagged"], np.nan, width)
            if np.isfinite(width).any():
                x = float(columns[axis][int(np.nanargmax(width))])
                domain = run.seam_domain(part) + ("" if axis == "s_mm" else "/px")
                return PlaceLink(text="the widest place", section="bead", domain=domain, x=x)
    return None


def _photo(run: Run, place: PlaceLink | None, at: dict[str, float]) -> PictureBlock | None:
    for part in _beads(run):
        track = toe_track(run, part, part.pictures[_OVERLAY])
        block = picture_block(run, part, _OVERLAY, track, _WIDEST_PX)
        if not isinstance(block, PictureBlock):
            continue
        mark = None
        if track is not None and place is not None and track.domain in at:
            mark = mark_on(track, at[track.domain], place.text)
        marks = [mark] if mark else []
        return block.model_copy(update={"id": f"{block.id}-moment", "marks": marks})
    return None


def _beads(run: Run) -> Sequence[Part]:
    return [part for part in run.of("bead") if _OVERLAY in part.pictures]


def _frames(run: Run) -> Frames | None:
    for part in run.parts:
        for block in frame_blocks(run, part):
            if isinstance(block, Frames):
                return block
    return None


def _frame(run: Run, frames: Frames | None, at: dict[str, float]) -> Frame | None:
    """The picture nearest to the moment; without a moment none is the right one."""
    if frames is None or run.time_domain not in at:
        return None
    seconds = at[run.time_domain]
    return min(frames.frames, key=lambda frame: abs(frame.seconds - seconds))
