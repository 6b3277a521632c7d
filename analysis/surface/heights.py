"""Heights from a session's laser stripe, as frames or as profiles, as a part of the results."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import PlaneCalibration, parse_calibration
from seamlog.errors import EvidenceError, InputError
from seamlog.results import Columns, Figure, Part, Picture, input_of

from .profile import ProfileFigures, profile_figures
from .stripe import Stripe, find_stripe

if TYPE_CHECKING:
    from seamlog.frames import Frame
    from seamlog.session import Session
    from seamlog.welds import Weld

Floats = NDArray[np.float64]

FRAMES, PROFILES = "/camera/stripe", "/seam/profile"
CALIBRATION = "calibration/laser_from_camera.json"
MOST = 200
"""Profiles that are looked at, evenly spread over the weld."""
_UNITS = {
    "stamp_ns": "ns",
    "height_mm": "mm",
    "toe_angle_left_deg": "deg",
    "toe_angle_right_deg": "deg",
    "undercut_depth_mm": "mm",
    "misalignment_mm": "mm",
    "profile_width_mm": "mm",
}


@dataclass(frozen=True, slots=True)
class _Seen:
    """A profile with its time, and what was drawn from where it is a frame."""

    stamp_ns: int
    figures: ProfileFigures
    frame: "Frame | None" = None
    stripe: Stripe | None = None


Tables = Mapping[str, tuple[Columns, Mapping[str, str]]]
Pictures = Mapping[str, tuple[bytes, Picture]]
Heights = tuple[Part, Tables, Pictures]
"""The part, its tables and its pictures."""


def heights_part(session: "Session", weld: "Weld | None" = None) -> Heights | None:
    """Part `profile` with the table `profiles`; None where the session has no laser stripe.

    The stripe of a weld is looked for from its start to that of the next one.
    """
    topic = next((name for name in (PROFILES, FRAMES) if name in session.info.channels), None)
    if topic is None:
        return None
    refused: list[str] = []
    seen = []
    try:
        source = _of_profiles if topic == PROFILES else _of_frames
        seen = list(source(session, _span(session, weld), refused))
    except EvidenceError as error:
        refused.append(str(error))
    number = weld.number if weld else None
    part = Part(
        part="profile",
        index=number or 1,
        title="Laser profiles across the bead",
        weld=number,
        inputs=[input_of(path) for path in session.paths],
        reason="profiles are judged by limits in part quality, if any were given",
        figures=_figures(seen, refused),
        details={"topic": topic, "not_measured": len(refused)},
    )
    if not seen:
        return part, {}, {}
    return part, {"profiles": (_columns(seen), _UNITS)}, _pictures(seen)


def heights_of(part: Part) -> tuple[Figure, ...]:
    """The figures of part `profile` that part `surface` lacks without a laser."""
    return tuple(figure for figure in part.figures if figure.name in _LABELS)


def _span(session: "Session", weld: "Weld | None") -> tuple[int, int]:
    if weld is None:
        return 0, np.iinfo(np.int64).max
    later = [each.start_ns for each in session.welds if each.start_ns > weld.start_ns]
    return weld.start_ns, min(later, default=int(np.iinfo(np.int64).max))


def _spread(stamp_ns: NDArray[np.int64], span: tuple[int, int]) -> NDArray[np.intp]:
    inside = np.flatnonzero((stamp_ns >= span[0]) & (stamp_ns < span[1]))
    if len(inside) <= MOST:
        return inside
    return inside[np.linspace(0, len(inside) - 1, MOST).astype(np.intp)]


def _of_profiles(session: "Session", span: tuple[int, int], refused: list[str]) -> Iterator[_Seen]:
    columns = session.columns(PROFILES)
    for at in _spread(columns["stamp_ns"], span):
        x_mm, z_mm = (1e3 * np.asarray(columns[name][at], dtype=np.float64) for name in _FIELDS)
        stamp = int(columns["stamp_ns"][at])
        if len(x_mm) != len(z_mm):
            refused.append(f"{session.path}: {PROFILES} at {stamp} ns: x and z differ in length")
            continue
        try:
            yield _Seen(stamp, profile_figures(x_mm, z_mm))
        except EvidenceError as error:
            refused.append(str(error))


_FIELDS = ("x_m", "z_m")


def _of_frames(session: "Session", span: tuple[int, int], refused: list[str]) -> Iterator[_Seen]:
    calibration = _calibration(session)
    frames = session.frames(FRAMES)
    for at in _spread(frames.stamps_ns, span):
        frame = frames[int(at)]
        try:
            stripe = find_stripe(frame.image(), frame.where)
            places = calibration.plane_mm(stripe.px)
            x_mm = np.where(stripe.seen, places[:, 0], np.nan)
            figures = profile_figures(x_mm, places[:, 1], calibration.scale_relative_u)
        except (EvidenceError, InputError) as error:
            refused.append(str(error))
            continue
        yield _Seen(frame.stamp_ns, figures, frame, stripe)


def _calibration(session: "Session") -> PlaneCalibration:
    if CALIBRATION not in session.attachments:
        raise EvidenceError(
            f"{session.path} has no attachment {CALIBRATION}: the stripe is known in pixels only; "
            "make one with 'seamlog calibrate laser' and attach it"
        )
    where = f"{session.path}: {CALIBRATION}"
    found = parse_calibration(session.attachments[CALIBRATION].data, where)
    if not isinstance(found, PlaneCalibration) or found.frame != "laser":
        raise EvidenceError(f"{where} is no calibration of a light plane (frame: laser)")
    return found


def _figures(seen: list[_Seen], refused: list[str]) -> list[Figure]:
    """The worst of each over all profiles; without a profile the reason."""
    count = Figure(name="profiles", label="Profiles measured", value=len(seen), unit="1")
    if not seen:
        why = refused[0] if refused else "no profile lies in the weld"
        return [
            Figure(name=name, label=label, value=None, unit=unit, reason=why)
            for name, (label, unit) in _LABELS.items()
        ]
    each = [item.figures for item in seen]
    highest = max(each, key=lambda f: f.height_mm)
    deepest = max(each, key=lambda f: f.undercut_mm)
    apart = max(each, key=lambda f: f.misalignment_mm)
    shown: dict[str, tuple[float, float | None]] = {
        "height_mm": (highest.height_mm, highest.u_height_mm),
        "toe_angle_deg": (min(min(f.toe_angles_deg) for f in each), None),
        "undercut_depth_mm": (deepest.undercut_mm, deepest.u_height_mm),
        "misalignment_mm": (apart.misalignment_mm, apart.u_height_mm),
    }
    told = f"of {len(seen)} profiles"
    told += f"; {len(refused)} could not be measured" if refused else ""
    return [
        count,
        *(
            Figure(name=name, label=_LABELS[name][0], value=value, unit=_LABELS[name][1], u=u,
                   reason=told)
            for name, (value, u) in shown.items()
        ),
    ]  # fmt: skip


_LABELS = {
    "height_mm": ("Excess weld metal, greatest height over the toes", "mm"),
    "toe_angle_deg": ("Toe angle, least, through the air, over the lowest millimetre", "deg"),
    "undercut_depth_mm": ("Undercut, greatest depth", "mm"),
    "misalignment_mm": ("Linear misalignment, greatest", "mm"),
}


def _columns(seen: list[_Seen]) -> Columns:
    each = [item.figures for item in seen]
    return {
        "stamp_ns": np.array([item.stamp_ns for item in seen], dtype=np.int64),
        "height_mm": np.array([f.height_mm for f in each]),
        "toe_angle_left_deg": np.array([f.toe_angles_deg[0] for f in each]),
        "toe_angle_right_deg": np.array([f.toe_angles_deg[1] for f in each]),
        "undercut_depth_mm": np.array([f.undercut_mm for f in each]),
        "misalignment_mm": np.array([f.misalignment_mm for f in each]),
        "profile_width_mm": np.array([f.width_mm for f in each]),
    }


def _pictures(seen: list[_Seen]) -> dict[str, tuple[bytes, Picture]]:
    """The frame with the deepest undercut, else the highest bead, and the stripe found in it."""
    worst = max(seen, key=lambda item: (item.figures.undercut_mm, item.figures.height_mm))
    if worst.frame is None or worst.stripe is None:
        return {}
    pixels = worst.frame.image()
    picture = cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if pixels.ndim == 2 else pixels.copy()
    for (x, y), clear in zip(np.rint(worst.stripe.px).astype(int), worst.stripe.seen, strict=True):
        colour = (80, 220, 60) if clear else (40, 40, 230)
        cv2.circle(picture, (int(x), int(y)), 1, colour, -1)
    done, data = cv2.imencode(".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, 82])
    if not done:
        raise ValueError("the frame of the laser stripe cannot be encoded")
    height, width = picture.shape[:2]
    told = Picture(
        file="stripe.webp",
        caption="Laser stripe as found (green; red where not seen)",
        width_px=width,
        height_px=height,
        sha256="",
    )
    return {"stripe": (data.tobytes(), told)}
