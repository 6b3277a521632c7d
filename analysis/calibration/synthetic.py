"""Rendered photos of boards with exactly known plane and lens, to check a calibration."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import Lens, PlaneCalibration, Points, projected, rows_of

from .board import Board

_PX_PER_SQUARE = 120
_NODE_PX = 4
_DARK, _BRIGHT, _PLATE = 40.0, 215.0, 120.0


@dataclass(frozen=True, slots=True)
class View:
    """A camera over a board: lens, picture size, place of the camera against the board.

    The camera stands `distance_mm` from the board's middle, leans by `tilt_deg` about the board's
    x and y axes and is turned about its own axis by `turn_deg`.
    """

    lens: Lens
    width_px: int
    height_px: int
    distance_mm: float
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    turn_deg: float = 0.0
    blur_px: float = 0.8
    noise: float = 0.0


def render_board(
    board: Board, view: View, seed: int = 0
) -> tuple[NDArray[np.uint8], PlaneCalibration]:
    """Photo (uint8, rows x columns) of a board, and the exact plane of its face."""
    matrix = _px_from_mm(board, view)
    sheet, mm_origin, px_per_mm = _sheet(board)
    to_mm = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    total = np.zeros((view.height_px, view.width_px))
    for shift_y in (-0.25, 0.25):
        for shift_x in (-0.25, 0.25):
            mm = _seen_mm(view, to_mm, (shift_x, shift_y)) - mm_origin
            at = (np.nan_to_num(mm, nan=-1e6) * px_per_mm - 0.5).astype(np.float32)
            x, y = at[..., 0], at[..., 1]
            total += cv2.remap(
                sheet, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=_PLATE
            )
    picture = cv2.GaussianBlur(total / 4, (0, 0), view.blur_px)
    picture = picture + view.noise * np.random.default_rng(seed).standard_normal(picture.shape)
    truth = PlaneCalibration(
        image_width_px=view.width_px,
        image_height_px=view.height_px,
        source="rendered",
        plane_mm_from_px=rows_of(to_mm),
        lens=view.lens,
        residual_mm=0.0,
        scale_relative_u=0.0,
    )
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8), truth


def _seen_mm(view: View, to_mm: NDArray[np.float64], shift: tuple[float, float]) -> Points:
    """Place on the board that each pixel sees, shape (rows, columns, 2): between nodes linear."""
    size = np.array([view.width_px, view.height_px])
    nodes = [np.arange(0, count + _NODE_PX, _NODE_PX, dtype=np.float64) for count in size]
    x, y = np.meshgrid(*nodes)
    seen = np.column_stack([x.ravel() + shift[0], y.ravel() + shift[1]])
    mm = projected(to_mm, view.lens.straightened(seen)).reshape(*x.shape, 2)
    across, down = (_weights(int(count), len(at)) for count, at in zip(size, nodes, strict=True))
    return np.stack([down @ mm[..., k] @ across.T for k in range(2)], axis=-1)


def _weights(count: int, nodes: int) -> NDArray[np.float64]:
    """Linear interpolation from nodes to pixels as a matrix, shape (count, nodes)."""
    at = np.arange(count) / _NODE_PX
    return np.clip(1.0 - np.abs(at[:, None] - np.arange(nodes)), 0.0, 1.0)


def _sheet(board: Board) -> tuple[NDArray[np.float32], Points, float]:
    """The printed face with a white rim, the mm of its first corner, and its resolution.

    mm counts from the board's first inner corner for a chessboard, from its edge for ChArUco.
    """
    px_per_mm = _PX_PER_SQUARE / board.square_mm
    if board.marker_mm is None:
        column, row = np.meshgrid(np.arange(board.columns), np.arange(board.rows))
        squares = np.where((column + row) % 2 == 0, _DARK, _BRIGHT)
        face = np.kron(squares, np.ones((_PX_PER_SQUARE, _PX_PER_SQUARE)))
        first = 1
    else:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
        size = (board.columns, board.rows)
        printed = cv2.aruco.CharucoBoard(size, board.square_mm, board.marker_mm, dictionary)
        image = printed.generateImage(
            (board.columns * _PX_PER_SQUARE, board.rows * _PX_PER_SQUARE), marginSize=0
        )
        face = _DARK + (_BRIGHT - _DARK) / 255 * np.asarray(image, dtype=np.float64)
        first = 0
    sheet = np.pad(face, _PX_PER_SQUARE, constant_values=_BRIGHT).astype(np.float32)
    rim = board.square_mm * (1 + first)
    return sheet, np.array([-rim, -rim]), px_per_mm


def _px_from_mm(board: Board, view: View) -> NDArray[np.float64]:
    lean_x, lean_y = np.radians(view.tilt_deg)
    about_x = np.array(
        [[1, 0, 0], [0, np.cos(lean_x), -np.sin(lean_x)], [0, np.sin(lean_x), np.cos(lean_x)]]
    )
    about_y = np.array(
        [[np.cos(lean_y), 0, np.sin(lean_y)], [0, 1, 0], [-np.sin(lean_y), 0, np.cos(lean_y)]]
    )
    turn = np.radians(view.turn_deg)
    about_z = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]]
    )
    rotation = about_z @ about_x @ about_y
    less = 1 if board.marker_mm is None else 0
    middle = board.square_mm * (np.array([board.columns, board.rows]) / 2 - less)
    origin = np.array([0, 0, view.distance_mm]) - rotation[:, :2] @ middle
    return np.asarray(view.lens.matrix() @ np.column_stack([rotation[:, :2], origin]))
