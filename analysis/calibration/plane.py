"""A photo of a board lying on the plate to a plane calibration, with where its error comes from."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import (
    LensCalibration,
    PlaneCalibration,
    Points,
    projected,
    rows_of,
)
from seamlog.errors import CalibrationError, UsageError

from .board import Board, find_board
from .planar import PlaneFit, fit_plane

Matrix = NDArray[np.float64]

TYPICAL_FOCAL = 1.2
"""Focal length of an unknown camera, in longer sides of the picture."""


@dataclass(frozen=True, slots=True)
class Placing:
    """How the board lay: its thickness, the camera's distance (None: from the lens, or typical).

    `square_u_mm` is the standard uncertainty of a square's side, `height_u_mm` how well the board
    lies in the plane of the bead's toes.
    """

    thickness_mm: float = 0.0
    distance_mm: float | None = None
    square_u_mm: float = 0.0
    height_u_mm: float = 0.2


def calibrate_plane(
    pixels: NDArray[Any],
    board: Board,
    placing: Placing,
    lens: LensCalibration | None = None,
    name: str = "photo",
    date: str | None = None,
) -> PlaneCalibration:
    """Plane in which the board lay, or `placing.thickness_mm` below it: the plate.

    Raises `EvidenceError` without a board, `CalibrationError` for a lens of another size.
    """
    size = (int(pixels.shape[1]), int(pixels.shape[0]))
    if lens is not None and size != (lens.image_width_px, lens.image_height_px):
        raise CalibrationError(
            f"{name} has {size[0]} x {size[1]} px and the lens is for {lens.image_width_px} x "
            f"{lens.image_height_px} px; use the lens of this camera and picture size"
        )
    view = find_board(pixels, board, name)
    fit = fit_plane(view, size, lens.lens if lens else None)
    known = placing.distance_mm or (_distance_mm(fit, lens) if lens else None)
    matrix = fit.mm_from_px
    if placing.thickness_mm:
        matrix = _lowered(matrix, placing.thickness_mm, known, lens, size)
    distance = known or TYPICAL_FOCAL * max(size) * mm_per_px(matrix, size)
    return PlaneCalibration(
        image_width_px=size[0],
        image_height_px=size[1],
        date=date,
        source=_source(board, placing, fit, distance, known is not None),
        plane_mm_from_px=rows_of(matrix),
        lens=fit.lens,
        residual_mm=fit.residual_mm,
        scale_relative_u=_scale_u(board, placing, fit, view.mm, distance),
    )


def _scale_u(
    board: Board, placing: Placing, fit: PlaneFit, mm: Points, distance_mm: float
) -> float:
    """Relative standard uncertainty: squares, height of the plane, scatter of the corners."""
    radius = float(np.sqrt(np.mean(np.sum((mm - mm.mean(axis=0)) ** 2, axis=1))))
    scatter = fit.residual_mm / (np.sqrt(fit.corners) * radius)
    squares = placing.square_u_mm / board.square_mm
    return float(np.sqrt(squares**2 + (placing.height_u_mm / distance_mm) ** 2 + scatter**2))


def _source(board: Board, placing: Placing, fit: PlaneFit, distance_mm: float, known: bool) -> str:
    lens = "with the lens's distortion" if fit.lens else "no distortion of the lens seen"
    far = f"{distance_mm:.0f} mm away" + ("" if known else " (typical lens)")
    squares = f"{placing.square_u_mm:g} mm" if placing.square_u_mm else "taken as exact"
    return (
        f"{board}, {fit.corners} corners, {lens}, residual {fit.residual_px:.3f} px; camera {far}, "
        f"height known to {placing.height_u_mm:g} mm, squares {squares}, board "
        f"{placing.thickness_mm:g} mm thick"
    )


def mm_per_px(matrix: Matrix, size_px: tuple[int, int]) -> float:
    """Length of a pixel in the middle of the picture."""
    middle = np.array([size_px], dtype=np.float64) / 2
    step = projected(matrix, middle + np.array([[0.5, 0.0]])) - projected(
        matrix, middle - np.array([[0.5, 0.0]])
    )
    return float(np.hypot(*step[0]))


def _pose(mm_from_px: Matrix, lens: LensCalibration) -> tuple[Matrix, Matrix]:
    """Rotation (columns: the plane's axes) and place of its origin, mm, seen from the camera."""
    raw = np.linalg.inv(lens.lens.matrix()) @ np.linalg.inv(mm_from_px)
    raw /= np.sqrt(np.linalg.norm(raw[:, 0]) * np.linalg.norm(raw[:, 1]))
    if raw[2, 2] < 0:
        raw = -raw
    return np.column_stack([raw[:, 0], raw[:, 1], np.cross(raw[:, 0], raw[:, 1])]), raw[:, 2]


def _distance_mm(fit: PlaneFit, lens: LensCalibration) -> float:
    """From the camera to the plane along the optical axis."""
    axes, origin = _pose(fit.mm_from_px, lens)
    return float(axes[:, 2] @ origin / axes[2, 2])


def _lowered(
    matrix: Matrix,
    thickness_mm: float,
    distance_mm: float | None,
    lens: LensCalibration | None,
    size_px: tuple[int, int],
) -> Matrix:
    """The plane `thickness_mm` further from the camera than the board's face."""
    if lens is not None:
        axes, origin = _pose(matrix, lens)
        lower = np.column_stack([axes[:, 0], axes[:, 1], origin - thickness_mm * axes[:, 2]])
        return np.asarray(np.linalg.inv(lens.lens.matrix() @ lower))
    if distance_mm is None:
        raise UsageError(
            f"a board {thickness_mm:g} mm thick needs the camera's --lens, or --distance-mm from "
            "camera to board"
        )
    (x, y) = projected(matrix, np.array([size_px], dtype=np.float64) / 2)[0]
    grown = 1.0 + thickness_mm / distance_mm
    about = np.array([[grown, 0, (1 - grown) * x], [0, grown, (1 - grown) * y], [0, 0, 1.0]])
    return np.asarray(about @ matrix)
