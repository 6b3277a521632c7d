"""The seam as the camera saw it, as a part of the results: pictures of the welds, the path found.

The pictures are thumbnails with the seam points and the torch's marker drawn in, evenly over the
welds, so that a report can show the moment of any place without opening the session.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ImageError, LimitExceeded, SessionError
from seamlog.results import Figure, Finding, Part, Picture, Severity, input_of

from .part_tables import Tables
from .torch_path import MARKER

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from seamlog.frames import Frames
    from seamlog.session import Session
    from seamlog.welds import Weld

IMAGE, POINTS, PATH = "/camera/image", "/seam/points", "/seam/path"
MOST_PICTURES = 120
WIDEST_PX = 320
_QUALITY = 55
_POINT, _MARKER = (120, 220, 60), (220, 80, 230)

Pictures = dict[str, tuple[bytes, Picture]]


def seam_part(session: "Session", welds: "Sequence[Weld]") -> tuple[Part, Tables, Pictures]:
    """Part `seam` of a session, with table `vision` and pictures that have a time."""
    seen = _Seen(session)
    pictures, broken = _pictures(session, welds, seen)
    part = Part(
        part="seam",
        title="Seam and path",
        inputs=[input_of(path) for path in session.paths],
        reason="no limits were given",
        figures=_figures(session, seen, len(pictures)),
        findings=broken,
    )
    return part, seen.tables(), pictures


class _Seen:
    """Seam points and markers of a session, by the stamp of their picture."""

    def __init__(self, session: "Session") -> None:
        self.points = _by_stamp(session, POINTS)
        self.markers = _by_stamp(session, MARKER)

    @property
    def with_points(self) -> int:
        """Pictures in which seam points were found."""
        return sum(len(x) > 0 for x, _ in self.points.values())

    def tables(self) -> Tables:
        """Number of seam points, and the marker, over time."""
        stamps = np.array(sorted({*self.points, *self.markers}), np.int64)
        if not len(stamps):
            return {}
        columns: dict[str, NDArray[Any]] = {"stamp_ns": stamps}
        units = {"stamp_ns": "ns"}
        if self.points:
            counts = [len(self.points[t][0]) if t in self.points else np.nan for t in stamps]
            columns["seam_points"] = np.array(counts, np.float64)
        for axis, name in enumerate(("marker_x_px", "marker_y_px")):
            if self.markers:
                found = [self.markers[t][axis] if t in self.markers else np.nan for t in stamps]
                columns[name] = np.array(found, np.float64)
                units[name] = "px"
        return {"vision": (columns, units)}


def _by_stamp(session: "Session", topic: str) -> dict[int, tuple[Any, Any]]:
    if topic not in session.info.channels:
        return {}
    columns = session.columns(topic, ["stamp_ns", "x_px", "y_px"])
    rows = zip(columns["stamp_ns"].tolist(), columns["x_px"], columns["y_px"], strict=True)
    return {stamp: (x, y) for stamp, x, y in rows}


def _figures(session: "Session", seen: _Seen, kept: int) -> list[Figure]:
    channel = session.info.channels.get(IMAGE)
    none = "" if channel else f"the session has no {IMAGE}"
    count = channel.count if channel else None
    found = None if not seen.points else seen.with_points
    length_mm = _path_length_mm(session)
    return [
        Figure(name="pictures", label="camera pictures", value=count, reason=none),
        Figure(name="pictures_kept", label="of these shown in reports", value=kept),
        Figure(
            name="pictures_with_seam",
            label="pictures in which the seam was found",
            value=found,
            reason="" if found is not None else f"the session has no {POINTS}",
        ),
        Figure(
            name="path_length_mm",
            label="length of the seam path",
            value=length_mm,
            unit="mm",
            reason="" if length_mm is not None else f"the session has no {PATH}",
        ),
    ]


def _path_length_mm(session: "Session") -> float | None:
    """Length of the last path that the live system made; None without one."""
    if PATH not in session.info.channels or not session.info.channels[PATH].count:
        return None
    path: Mapping[str, NDArray[Any]] = session.columns(PATH)
    x, y = (1e3 * np.asarray(path[name][-1], np.float64) for name in ("x_m", "y_m"))
    return float(np.sum(np.hypot(np.diff(x), np.diff(y)))) if len(x) > 1 else None


def _pictures(
    session: "Session", welds: "Sequence[Weld]", seen: _Seen
) -> tuple[Pictures, list[Finding]]:
    """Thumbnails over the welds (over all without one); pictures that cannot be read are said."""
    if IMAGE not in session.info.channels:
        return {}, []
    try:
        frames = session.frames(IMAGE)
        stamps = frames.stamps_ns
    except SessionError as error:
        return {}, [Finding(severity=Severity.WARNING, message=str(error))]
    found: Pictures = {}
    broken: list[str] = []
    for number, place in enumerate(_chosen(stamps, welds)):
        try:
            found[f"frame_{number:03}"] = _thumbnail(frames, place, seen)
        except (ImageError, LimitExceeded, SessionError) as error:
            broken.append(str(error))
    if not broken:
        return found, []
    message = f"{len(broken)} camera pictures cannot be shown; the first: {broken[0]}"
    return found, [Finding(severity=Severity.WARNING, message=message)]


def _chosen(stamps: NDArray[np.int64], welds: "Sequence[Weld]") -> list[int]:
    """At most MOST_PICTURES places, evenly over the welds."""
    inside = np.zeros(len(stamps), np.bool_)
    for weld in welds:
        inside |= (stamps >= weld.start_ns) & (stamps <= weld.end_ns)
    places = np.flatnonzero(inside) if inside.any() else np.arange(len(stamps))
    wanted = min(MOST_PICTURES, len(places))
    picked = np.unique(np.rint(np.linspace(0, len(places) - 1, wanted)).astype(int))
    return [int(place) for place in places[picked]] if wanted else []


def _thumbnail(frames: "Frames", place: int, seen: _Seen) -> tuple[bytes, Picture]:
    import cv2

    frame = frames[place]
    image = frame.image()
    rows, columns = image.shape[:2]
    scale = min(1.0, WIDEST_PX / columns)
    size = (max(round(columns * scale), 1), max(round(rows * scale), 1))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    if small.ndim == 2:
        small = cv2.cvtColor(small, cv2.COLOR_GRAY2BGR)
    x, y = seen.points.get(frame.stamp_ns, ((), ()))
    for point in zip(x, y, strict=True):
        _dot(small, point, scale, 1, _POINT, -1)
    if frame.stamp_ns in seen.markers:
        _dot(small, seen.markers[frame.stamp_ns], scale, 6, _MARKER, 1)
    data = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])[1].tobytes()
    return data, Picture(
        file="frame.webp",
        caption="Camera, with the seam points (green) and the torch marker (ring) as found",
        width_px=size[0],
        height_px=size[1],
        sha256="",
        time_ns=frame.stamp_ns,
    )


def _dot(
    image: NDArray[Any],
    point: tuple[float, float],
    scale: float,
    radius_px: int,
    colour: tuple[int, int, int],
    thickness: int,
) -> None:
    import cv2

    if np.isfinite(point).all():
        centre = (round(scale * point[0]), round(scale * point[1]))
        cv2.circle(image, centre, radius_px, colour, thickness, cv2.LINE_AA)
