"""Pictures of the results: no larger than a page can show, tied to the places of the bead."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import UsageError
from seamlog.results import Part, Picture

from .content import AnyBlock, Frame, Frames, Notice, PictureBlock, PictureMark, Track
from .curves import Column
from .run import Run, anchor

MEDIA_TYPES = {
    ".webp": "image/webp",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
}
_WIDEST_PX = 1600
_MOST_BYTES = 400_000
_QUALITY = 80
_FRAME_WIDEST_PX, _FRAME_QUALITY = 320, 50
_OVERHANG = 0.5
"""How far a mark reaches beyond either toe, in widths of the bead."""
_TOES = ("left_x_px", "left_y_px", "right_x_px", "right_y_px")


def picture_block(
    run: Run, part: Part, name: str, track: Track | None = None, widest_px: int = _WIDEST_PX
) -> PictureBlock | Notice:
    """A picture of `part`; one in a format that browsers do not share becomes a notice."""
    picture = part.pictures[name]
    media_type = _media_type(picture)
    if not media_type:
        return _unknown(picture)
    image = run.results.picture(part, name)
    if picture.width_px > widest_px or len(image) > _MOST_BYTES:
        image, media_type = _reduced(image, media_type, widest_px)
    return PictureBlock(
        id=anchor("picture", str(run.index), part.stem, name),
        caption=picture.caption,
        alt=picture.caption or f"{part.title}: {name}",
        media_type=media_type,
        width_px=picture.width_px,
        height_px=picture.height_px,
        sha256=picture.sha256,
        image=image,
        track=track,
    )


def picture_of_pixels(name: str, image: NDArray[Any], caption: str) -> PictureBlock:
    """A caller's own picture, uint8, grey or BGR, as PNG."""
    import cv2

    if image.dtype != np.uint8 or image.ndim not in (2, 3) or not image.size:
        raise UsageError(f"{caption}: a picture is uint8 of 2 (grey) or 3 (BGR) dimensions")
    data = cv2.imencode(".png", image)[1].tobytes()
    media_type = "image/png"
    if image.shape[1] > _WIDEST_PX or len(data) > _MOST_BYTES:
        data, media_type = _reduced(data, media_type)
    return PictureBlock(
        id=anchor("picture", name),
        caption=caption,
        alt=caption,
        media_type=media_type,
        width_px=image.shape[1],
        height_px=image.shape[0],
        sha256=hashlib.sha256(data).hexdigest(),
        image=data,
    )


def frame_blocks(run: Run, part: Part) -> list[AnyBlock]:
    """The pictures of `part` that have a time, as one block that follows the cursor."""
    timed = {name: p for name, p in part.pictures.items() if p.time_ns is not None}
    known = {name: p for name, p in timed.items() if _media_type(p)}
    blocks: list[AnyBlock] = [_unknown(p) for name, p in timed.items() if name not in known]
    if not known:
        return blocks
    frames = [_frame(run, part, name, picture) for name, picture in known.items()]
    first = next(iter(known.values()))
    block = Frames(
        id=anchor("frames", str(run.index), part.stem),
        title=first.caption or "Camera",
        domain=run.time_domain,
        width_px=first.width_px,
        height_px=first.height_px,
        frames=sorted(frames, key=lambda frame: frame.seconds),
    )
    return [*blocks, block]


def _frame(run: Run, part: Part, name: str, picture: Picture) -> Frame:
    image, media_type = run.results.picture(part, name), _media_type(picture)
    if picture.width_px > _FRAME_WIDEST_PX:
        image, media_type = _reduced(image, media_type, _FRAME_WIDEST_PX, _FRAME_QUALITY)
    return Frame(
        seconds=run.second(picture.time_ns or 0),
        media_type=media_type,
        sha256=picture.sha256,
        image=image,
    )


def _media_type(picture: Picture) -> str:
    return MEDIA_TYPES.get(Path(picture.file).suffix.lower(), "")


def _unknown(picture: Picture) -> Notice:
    return Notice(text=f"Picture {picture.file}: not shown", reason="Its format is not known.")


def toe_track(run: Run, part: Part, picture: Picture, table: str = "stations") -> Track | None:
    """Where the stations of a bead lie on its photo, or None if the table does not say.

    The part's details say how large the photo was; without them the picture is the photo.
    """
    entry = part.tables.get(table)
    if entry is None or not set(_TOES) <= set(entry.columns):
        return None
    columns = run.columns(part, table)
    axis = "s_mm" if "s_mm" in columns else "s_px"
    if axis not in columns:
        return None
    order = np.argsort(columns[axis], kind="stable")
    suffix = "" if axis == "s_mm" else "/px"
    toes = {name: Column(values=columns[name][order]) for name in _TOES}
    x = Column(values=columns[axis][order])
    width_px = part.details.get("photo_width_px", picture.width_px)
    height_px = part.details.get("photo_height_px", picture.height_px)
    domain = run.seam_domain(part) + suffix
    return Track(domain=domain, width_px=width_px, height_px=height_px, x=x, **toes)


def mark_on(track: Track, x: float, label: str) -> PictureMark | None:
    """A line across the bead at place `x` of the track; None where the toes are not known."""
    places = track.x.values
    ends = (track.left_x_px, track.left_y_px, track.right_x_px, track.right_y_px)
    known = np.flatnonzero(np.isfinite(np.stack([places, *(end.values for end in ends)])).all(0))
    if not known.size or not places[known[0]] <= x <= places[known[-1]]:
        return None
    at = known[int(np.argmin(np.abs(places[known] - x)))]
    left_x, left_y, right_x, right_y = (float(end.values[at]) for end in ends)
    dx, dy = _OVERHANG * (right_x - left_x), _OVERHANG * (right_y - left_y)
    first = {"x1_px": round(left_x - dx, 1), "y1_px": round(left_y - dy, 1)}
    last = {"x2_px": round(right_x + dx, 1), "y2_px": round(right_y + dy, 1)}
    return PictureMark(label=label, **first, **last)


def _reduced(
    image: bytes, media_type: str, widest_px: int = _WIDEST_PX, quality: int = _QUALITY
) -> tuple[bytes, str]:
    """The picture as WebP at most `widest_px` wide; as it is where that does not work."""
    import cv2

    decoded = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR)
    if decoded is None:
        return image, media_type
    rows, columns = decoded.shape[:2]
    if columns > widest_px:
        size = (widest_px, max(round(rows * widest_px / columns), 1))
        decoded = cv2.resize(decoded, size, interpolation=cv2.INTER_AREA)
    done, coded = cv2.imencode(".webp", decoded, [cv2.IMWRITE_WEBP_QUALITY, quality])
    return (coded.tobytes(), "image/webp") if done else (image, media_type)
