"""A report no larger than somebody wants to mail: pictures are thinned first, and it is said.

Curves are never thinned, since that would hide what a zoom looks for: where pictures are not
enough, the largest plots stay in the file as drawings only, and the results keep their points.
"""

from collections.abc import Callable

from .content import AnyBlock, Frame, Frames, Moment
from .curves import Column, Plot
from .document import Document
from .page import columns_of, render

_FEWEST_PICTURES = 10
_BASE64 = 4 / 3
_MARKUP = 250
"""Bytes of a picture's element and entry in the twin."""


def fitted(document: Document, largest_bytes: int) -> tuple[Document, str]:
    """The document, cut down where its page would be larger than `largest_bytes`, and its page."""
    text = render(document)
    for cut in (_thin_pictures, _draw_only):
        excess = len(text.encode()) - largest_bytes
        if excess <= 0:
            break
        document = cut(document, excess)
        text = render(document)
    return document, text


def _thin_pictures(document: Document, excess: int) -> Document:
    """Every n-th camera picture, so that about `excess` bytes are saved."""
    blocks = {id(b): b for s in document.sections for b in s.blocks if isinstance(b, Frames)}
    total = sum(_weight(block) for block in blocks.values())
    count = sum(len(block.frames) for block in blocks.values())
    if not count:
        return document
    kept_share = max(1 - excess / total, 0.0)
    thinned = {
        key: block.model_copy(update={"frames": _every(block.frames, kept_share)})
        for key, block in blocks.items()
    }
    kept = sum(len(block.frames) for block in thinned.values())
    note = f"{kept} of {count} camera pictures are in this file, to keep it small."
    return _changed(document, lambda block: thinned.get(id(block), block), note)


def _weight(block: Frames) -> float:
    return sum(_BASE64 * len(frame.image) + _MARKUP for frame in block.frames)


def _every(items: list[Frame], share: float) -> list[Frame]:
    """About `share` of the pictures, evenly, but not fewer than `_FEWEST_PICTURES`."""
    wanted = min(max(int(share * len(items)), _FEWEST_PICTURES), len(items))
    if wanted == len(items):
        return items
    return [items[round(i * (len(items) - 1) / max(wanted - 1, 1))] for i in range(wanted)]


def _draw_only(document: Document, excess: int) -> Document:
    """The heaviest plots without their points, until about `excess` bytes are saved."""
    plots = [b for s in document.sections for b in s.blocks if isinstance(b, Plot) and b.live]
    users: dict[str, int] = {}
    for column in columns_of([document]):
        users[column.key] = users.get(column.key, 0) + 1
    own = {id(plot): _own_bytes(plot, users) for plot in plots}
    dropped: set[int] = set()
    for plot in sorted(plots, key=lambda plot: -own[id(plot)]):
        if excess <= 0:
            break
        dropped.add(id(plot))
        excess -= own[id(plot)]
    if not dropped:
        return document
    note = (
        f"{len(dropped)} of {len(plots)} plots are drawings without their points, to keep this "
        "file small; the results hold the points (report --tables, or a larger --max-mb)."
    )
    return _changed(
        document,
        lambda b: b.model_copy(update={"live": False}) if id(b) in dropped else b,
        note,
    )


def _own_bytes(plot: Plot, users: dict[str, int]) -> int:
    """Bytes of the columns that no other plot needs."""
    columns: dict[str, Column] = {column.key: column for column in columns_of([plot])}
    return sum(len(c.coded.data) for key, c in columns.items() if users.get(key, 0) <= 1)


def _changed(document: Document, change: Callable[[AnyBlock], AnyBlock], note: str) -> Document:
    """The document with each block as `change` gives it; moments follow their camera."""
    sections = [
        section.model_copy(
            update={"blocks": [_followed(change(b), change) for b in section.blocks]}
        )
        for section in document.sections
    ]
    return document.model_copy(update={"sections": sections, "notes": [*document.notes, note]})


def _followed(block: AnyBlock, change: Callable[[AnyBlock], AnyBlock]) -> AnyBlock:
    if isinstance(block, Moment) and block.frames is not None:
        return block.model_copy(update={"frames": change(block.frames)})
    return block
