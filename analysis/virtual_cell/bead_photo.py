"""The photo of the finished bead, from another camera: about 0.1 mm per pixel, start left.

Its edges are exactly those of the truth: half the width to each side of the torch's path, with a
scallop of 0.1 mm that averages out, covered by area at the border pixels.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .bead_surface import SCALLOP_MM, bead_colours, plate_colours, ripple_phase
from .seam import TrueSeam
from .spatter import scatter
from .texture import Shades, rounded
from .truth import BeadTruth
from .view import calibration_json, homography, project

Floats = NDArray[np.float64]
Grid = NDArray[np.float32]

WIDTH_PX, HEIGHT_PX = 2440, 700
_CORNERS_PX = ((0.0, 0.0), (2439.0, 0.0), (2439.0, 699.0), (0.0, 699.0))
_CORNERS_MM = ((-33.0, -20.5), (-36.5, 223.0), (34.2, 221.0), (35.5, -19.0))
"""(x, y) of the table frame at the corners; the bead itself knows nothing of them."""
_PLANE_FROM_TABLE = np.array([[0.9986, -0.0523, 61.0], [0.0523, 0.9986, 48.0], [0.0, 0.0, 1.0]])
"""The calibration board lay turned by 3 degrees, so its plane is not the table frame."""
CAP_MM = 2.0
"""The bead reaches this far beyond arc-on and arc-off, rounded."""
_BLUR_PX = 0.8
_NOISE = 2.0
_JPEG_QUALITY = 95
_SOURCE = (
    "Virtual photo camera, exact. The plane is the plate's top seen from above, right-handed with "
    "z up; its origin and its turn against the table frame are those of the board, not known."
)


@dataclass(frozen=True, slots=True)
class BeadPlace:
    """Each pixel against the bead, arrays of the photo's shape, mm.

    `s`: arc length of its foot on the torch's path; `offset`: signed distance from it, positive
    towards x; `half`: half width of the bead there; `outside`: distance beyond the toe.
    """

    s: Grid
    offset: Grid
    half: Grid
    outside: Grid


def render_bead_photo(
    bead: BeadTruth, seam: TrueSeam, rng: np.random.Generator
) -> tuple[bytes, bytes]:
    """JPEG and calibration JSON of the bead's photo."""
    mm_from_px = homography(_CORNERS_PX, _CORNERS_MM)
    columns, rows = np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
    points = project(mm_from_px, np.column_stack([columns.ravel(), rows.ravel()]))
    x = points[:, 0].reshape(HEIGHT_PX, WIDTH_PX).astype(np.float32)
    y = points[:, 1].reshape(HEIGHT_PX, WIDTH_PX).astype(np.float32)
    place = _place(bead, x, y)
    welded = _smooth_step((y + 1.5) / 2.0) * _smooth_step((bead.y_mm[-1] + 1.5 - y) / 2.0)
    beside = (x - np.interp(y, *_seam_table(seam))).astype(np.float32)
    picture = plate_colours(rng, place.outside, beside, welded.astype(np.float32))
    cover = np.clip(0.5 - place.outside / 0.1, 0.0, 1.0)[..., None]
    picture = cover * bead_colours(rng, place.s, place.offset, place.half) + (1 - cover) * picture
    scatter(picture, rng, place.outside)
    photo = _photograph(picture.astype(np.float32), rng)
    size = (WIDTH_PX, HEIGHT_PX)
    plane = _PLANE_FROM_TABLE @ mm_from_px
    return photo, calibration_json(plane / plane[2, 2], size, _SOURCE, in_table_frame=False)


def _seam_table(seam: TrueSeam) -> tuple[Floats, Floats]:
    y = np.linspace(-25.0, 225.0, 1001)
    return y, seam.x_mm(y)


def _place(bead: BeadTruth, x: Grid, y: Grid) -> BeadPlace:
    """Foot points by Newton's method on the path x = p(y), straight on beyond the bead."""
    path_y, path_x = _prolonged(bead)
    slope_mm = np.gradient(path_x, path_y)
    foot = np.array(y)
    for _ in range(3):
        slope = np.interp(foot, path_y, slope_mm)
        gap = x - np.interp(foot, path_y, path_x)
        foot = foot + ((y - foot) + gap * slope) / (1.0 + slope * slope)
    aside = x - np.interp(foot, path_y, path_x)
    offset = np.hypot(aside, y - foot) * np.sign(aside)
    along = np.hypot(1.0, np.interp(foot, path_y, slope_mm))
    beyond = np.maximum(np.maximum(-foot, foot - bead.y_mm[-1]), 0.0) * along
    s = np.interp(foot, bead.y_mm, bead.s_mm) + np.sign(foot) * beyond
    full = 0.5 * np.interp(foot, bead.y_mm, bead.width_mm)
    full += SCALLOP_MM * (np.abs(np.sin(0.5 * ripple_phase(s, offset, full))) - 0.6366)
    reach = np.hypot(offset / full, beyond / CAP_MM)
    outside = np.hypot(offset, beyond) * (1.0 - 1.0 / np.maximum(reach, 1e-3))
    half = full * np.sqrt(np.clip(1.0 - (beyond / CAP_MM) ** 2, 0.04, 1.0))
    return BeadPlace(*(grid.astype(np.float32) for grid in (s, offset, half, outside)))


def _prolonged(bead: BeadTruth) -> tuple[Floats, Floats]:
    more_mm = np.array([-60.0, 60.0])
    ends = (bead.y_mm[[0, -1]], bead.path_x_mm[[0, -1]])
    slopes = [
        (bead.path_x_mm[b] - bead.path_x_mm[a]) / (bead.y_mm[b] - bead.y_mm[a])
        for a, b in ((0, 10), (-11, -1))
    ]
    far_y, far_x = ends[0] + more_mm, ends[1] + more_mm * slopes
    return (
        np.concatenate([far_y[:1], bead.y_mm, far_y[1:]]),
        np.concatenate([far_x[:1], bead.path_x_mm, far_x[1:]]),
    )


def _smooth_step(share: NDArray[np.floating]) -> Grid:
    inside = np.clip(share, 0.0, 1.0)
    return np.asarray(inside * inside * (3.0 - 2.0 * inside), dtype=np.float32)


def _photograph(picture: Shades, rng: np.random.Generator) -> bytes:
    """Uneven light, lens, noise, JPEG."""
    y, x = np.mgrid[-1.0 : 1.0 : HEIGHT_PX * 1j, -1.0 : 1.0 : WIDTH_PX * 1j].astype(np.float32)
    light = 1.03 + 0.07 * x - 0.05 * y - 0.07 * x * x
    lit = np.asarray(cv2.GaussianBlur(picture * light[..., None], (0, 0), _BLUR_PX))
    lit = lit + _NOISE * rng.standard_normal(lit.shape, dtype=np.float32)
    done, data = cv2.imencode(".jpg", rounded(lit), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    assert done
    return bytes(data.tobytes())
