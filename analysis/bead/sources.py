"""Which photos are measured and with which calibration: files, or what a session has attached."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from seamlog.calibration import Calibration, load_calibration, parse_calibration
from seamlog.errors import InputError, SeamlogError
from seamlog.results import Input, input_of

from .image import Photo, decode_photo, load_photo
from .plane import Points

if TYPE_CHECKING:
    from seamlog.session import Session

PHOTO, CALIBRATION = "photo/", "calibration/"
PATH, FRAMES = "/seam/path", "/camera/image"
_SUFFIX = ".calibration.json"


@dataclass(frozen=True, slots=True)
class Before:
    """A picture of the plate from before welding; one that a user named must show this plate."""

    photo: Photo
    was_named: bool


@dataclass(frozen=True, slots=True)
class PhotoSource:
    """A photo with its calibration (None: pixels) and the files both came from."""

    photo: Photo
    calibration: Calibration | None
    inputs: tuple[Input, ...]


def photo_files(paths: tuple[Path, ...], calibration: Path | None) -> list[PhotoSource]:
    """Photos from files; without `calibration` the `<stem>.calibration.json` beside each."""
    return [_from_file(path, calibration or _beside(path)) for path in paths]


def _beside(path: Path) -> Path | None:
    beside = path.with_name(path.stem + _SUFFIX)
    return beside if beside.is_file() else None


def _from_file(path: Path, calibration: Path | None) -> PhotoSource:
    photo = load_photo(path)
    inputs = [input_of(path)]
    if calibration is None:
        return PhotoSource(photo, None, tuple(inputs))
    if not calibration.is_file():
        raise InputError(f"{calibration}: no such calibration file; check the name")
    inputs.append(input_of(calibration))
    return PhotoSource(photo, load_calibration(calibration), tuple(inputs))


def logged_seam_mm(session: "Session") -> Points | None:
    """The last path of the seam in the log, table frame, shape (n, 2); None without one."""
    if PATH not in session.info.channels or not session.info.channels[PATH].count:
        return None
    logged = session.columns(PATH)
    x, y = (1e3 * np.asarray(logged[name][-1], dtype=np.float64) for name in ("x_m", "y_m"))
    return np.column_stack([x, y]) if 1 < len(x) == len(y) else None


def frame_before(session: "Session", arc_on_ns: int) -> Before | None:
    """The log's last camera picture from before log time `arc_on_ns`; None without a whole one.

    Nobody asked for it, so a picture that cannot be read is none.
    """
    if FRAMES not in session.info.channels:
        return None
    try:
        frames = session.frames()
        count = int(np.searchsorted(frames.log_times_ns, arc_on_ns))
        if not count:
            return None
        last = frames[count - 1]
        return Before(decode_photo(last.data, last.where), was_named=False)
    except SeamlogError:
        return None


def attached_photos(session: "Session", calibration: Path | None = None) -> list[PhotoSource]:
    """Photos attached to a session, each with the attached calibration of its name, if any."""
    names = [name for name in session.attachments if name.startswith(PHOTO)]
    return [_from_session(session, name, calibration) for name in names]


def _from_session(session: "Session", name: str, calibration: Path | None) -> PhotoSource:
    where = f"{session.path}: {name}"
    photo = decode_photo(session.attachments[name].data, where)
    inputs = [input_of(path) for path in session.paths]
    if calibration is not None:
        inputs.append(input_of(calibration))
        return PhotoSource(photo, load_calibration(calibration), tuple(inputs))
    attached = CALIBRATION + Path(name).stem + _SUFFIX
    if attached not in session.attachments:
        return PhotoSource(photo, None, tuple(inputs))
    found = parse_calibration(session.attachments[attached].data, f"{session.path}: {attached}")
    return PhotoSource(photo, found, tuple(inputs))
