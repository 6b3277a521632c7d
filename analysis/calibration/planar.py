"""One view of a board to a plane in millimetres, with the lens's distortion where it shows.

From one view of one plane the focal length cannot be told, but it is not needed either: any will
do with the distortion that goes with it. How many coefficients of distortion the corners carry is
decided by the Bayesian information criterion.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from seamlog.calibration import Lens, Points, projected
from seamlog.errors import EvidenceError

from .board import FEWEST_CORNERS, BoardView

Matrix = NDArray[np.float64]

WORST_RESIDUAL_PX = 1.0
_MODELS = (
    (),
    ("k1",),
    ("k1", "k2"),
    ("k1", "k2", "p1", "p2"),
    ("k1", "k2", "k3", "x", "y"),
    ("k1", "k2", "k3", "p1", "p2", "x", "y"),
)
"""Sets of numbers that the distortion may take: coefficients and the centre of the picture."""
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3")
_CENTRE_SCALE_PX = 100.0
_MOST_MISPLACED = 0.25
"""Part of the corners that may be left out as mistaken."""


@dataclass(frozen=True, slots=True)
class PlaneFit:
    """A plane found from a view: homography mm from undistorted px, lens, rms residuals."""

    mm_from_px: Matrix
    lens: Lens | None
    residual_px: float
    residual_mm: float
    corners: int


def fit_plane(view: BoardView, size_px: tuple[int, int], lens: Lens | None = None) -> PlaneFit:
    """Plane of a board; with `lens` its distortion is taken, without it is fitted if it shows.

    The plane's frame is right-handed with z towards the camera. `EvidenceError` where corners and
    board do not fit each other.
    """
    if len(view.px) < FEWEST_CORNERS:
        raise EvidenceError(
            f"{view.name}: {len(view.px)} corners are too few, {FEWEST_CORNERS} are needed"
        )
    found, matrix, residual = _fitted(view, size_px, lens)
    good = _in_place(residual)
    if not good.all() and good.mean() >= 1 - _MOST_MISPLACED and good.sum() >= FEWEST_CORNERS:
        view = BoardView(view.px[good], view.mm[good], view.name)
        found, matrix, residual = _fitted(view, size_px, lens)
    rms_px = float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))
    if rms_px > WORST_RESIDUAL_PX:
        raise EvidenceError(
            f"{view.name}: the corners miss the board by {rms_px:.2f} px rms: a bent board, a "
            "wrong number of squares, or a lens of another camera"
        )
    mm_from_px = _z_up(np.asarray(np.linalg.inv(matrix), dtype=np.float64), size_px)
    apart = _mm(mm_from_px, found, view.px) - _mm(mm_from_px, found, view.px + residual)
    rms_mm = float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))
    used = found if any(found.distortion) else None
    return PlaneFit(mm_from_px, used, rms_px, rms_mm, len(view.px))


def _in_place(residual: Points) -> NDArray[np.bool_]:
    """Corners that were not mistaken for something else, such as the corner of a marker."""
    size = np.hypot(*residual.T)
    return np.asarray(size < max(5.0 * float(np.median(size)), 0.1))


def _fitted(
    view: BoardView, size_px: tuple[int, int], lens: Lens | None
) -> tuple[Lens, Matrix, Points]:
    if lens is None:
        return _fit_with_distortion(view, size_px)
    matrix = _refined_homography(view.mm, view.px, lens)
    return lens, matrix, lens.distorted(projected(matrix, view.mm)) - view.px


def _mm(matrix: Matrix, lens: Lens, px: Points) -> Points:
    return projected(matrix, lens.straightened(px))


def _z_up(matrix: Matrix, size_px: tuple[int, int]) -> Matrix:
    """The frame's y turned over if need be: from above, a right-handed plane has y upwards."""
    middle = np.array([size_px], dtype=np.float64) / 2
    origin, right, down = (
        projected(matrix, middle + np.array(step)) for step in ((0, 0), (1, 0), (0, 1))
    )
    (ax, ay), (bx, by) = (right - origin)[0], (down - origin)[0]
    return matrix if ax * by - ay * bx < 0 else np.diag([1.0, -1.0, 1.0]) @ matrix


def _homography(mm: Points, px: Points) -> Matrix:
    matrix, _ = cv2.findHomography(mm, px, 0)
    if matrix is None:
        raise EvidenceError("the corners lie on one line, so they carry no plane")
    return np.asarray(matrix / matrix[2, 2], dtype=np.float64)


def _refined_homography(mm: Points, px: Points, lens: Lens) -> Matrix:
    start = _homography(mm, lens.straightened(px))

    def misses(entries: NDArray[np.float64]) -> NDArray[np.float64]:
        ideal = projected(np.append(entries, 1.0).reshape(3, 3), mm)
        return (lens.distorted(ideal) - px).ravel()

    solved = least_squares(misses, start.ravel()[:8], x_scale="jac", method="lm")
    return np.append(solved.x, 1.0).reshape(3, 3)


def _fit_with_distortion(
    view: BoardView, size_px: tuple[int, int]
) -> tuple[Lens, Matrix, NDArray[np.float64]]:
    """Lens, homography px from mm and residual of the model with the least BIC."""
    start = _homography(view.mm, view.px)
    best: tuple[float, Lens, Matrix, NDArray[np.float64]] | None = None
    count = 2 * len(view.px)
    for names in _MODELS:
        free = 8 + len(names)
        if count < 3 * free:
            break
        lens, matrix, misses = _fit(view, size_px, start, names)
        spread = max(float(np.mean(misses**2)), 1e-12)
        bic = count * float(np.log(spread)) + free * float(np.log(count))
        if best is None or bic < best[0] - 2.0:
            best = (bic, lens, matrix, misses)
    assert best is not None
    return best[1], best[2], best[3]


def _fit(
    view: BoardView, size_px: tuple[int, int], start: Matrix, names: tuple[str, ...]
) -> tuple[Lens, Matrix, NDArray[np.float64]]:
    def parts(values: NDArray[np.float64]) -> tuple[Lens, Matrix]:
        return _lens(size_px, names, values[8:]), np.append(values[:8], 1.0).reshape(3, 3)

    def misses(values: NDArray[np.float64]) -> NDArray[np.float64]:
        lens, matrix = parts(values)
        return (lens.distorted(projected(matrix, view.mm)) - view.px).ravel()

    first = np.concatenate([start.ravel()[:8], np.zeros(len(names))])
    solved = least_squares(misses, first, x_scale="jac", method="lm")
    lens, matrix = parts(solved.x)
    return lens, matrix, misses(solved.x).reshape(-1, 2)


def _lens(size_px: tuple[int, int], names: tuple[str, ...], values: NDArray[np.float64]) -> Lens:
    given = dict(zip(names, (float(value) for value in values), strict=True))
    focal = float(max(size_px))
    k1, k2, p1, p2, k3 = (given.get(name, 0.0) for name in _COEFFICIENTS)
    return Lens(
        focal_x_px=focal,
        focal_y_px=focal,
        centre_x_px=(size_px[0] - 1) / 2 + _CENTRE_SCALE_PX * given.get("x", 0.0),
        centre_y_px=(size_px[1] - 1) / 2 + _CENTRE_SCALE_PX * given.get("y", 0.0),
        distortion=(k1, k2, p1, p2, k3),
    )
