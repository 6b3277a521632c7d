"""Boards in photos: where the corners of a chessboard or a ChArUco board lie."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import Points
from seamlog.errors import EvidenceError, UsageError

FEWEST_CORNERS = 12
_SMALLEST_SQUARE_PX = 5.0
_STEPS = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)


@dataclass(frozen=True, slots=True)
class Board:
    """A printed board: squares across and down, side of a square in mm.

    `marker_mm` and `dictionary` are those of a ChArUco board; without marker it is a chessboard.
    """

    columns: int
    rows: int
    square_mm: float
    marker_mm: float | None = None
    dictionary: str = "DICT_4X4_50"

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 4:
            raise UsageError(
                f"a board of {self.columns} x {self.rows} squares has too few corners; use one "
                "with at least 4 x 4 squares"
            )
        if self.square_mm <= 0:
            raise UsageError(f"a square of {self.square_mm:g} mm cannot be; give its side in mm")
        if self.marker_mm is not None and not 0 < self.marker_mm < self.square_mm:
            raise UsageError(
                f"a marker of {self.marker_mm:g} mm does not fit a square of {self.square_mm:g} mm"
            )

    def __str__(self) -> str:
        kind = "chessboard" if self.marker_mm is None else f"ChArUco board ({self.dictionary})"
        return f"{kind} of {self.columns} x {self.rows} squares of {self.square_mm:g} mm"


@dataclass(frozen=True, slots=True)
class BoardView:
    """Corners of a board in one photo: `px` and `mm`, each of shape (n, 2)."""

    px: Points
    mm: Points
    name: str


def find_board(pixels: NDArray[Any], board: Board, name: str) -> BoardView:
    """Corners of `board` in a photo, refined below a pixel; `EvidenceError` without a board."""
    grey = _grey8(pixels)
    find = _chessboard if board.marker_mm is None else _charuco
    found = find(grey, board)
    if found is None:
        raise EvidenceError(
            f"{name}: no {board} was found; check the numbers of squares, and that the whole "
            "board is in the photo, sharp and evenly lit"
        )
    px, mm = found
    if _square_px(px, mm, board) < _SMALLEST_SQUARE_PX:
        raise EvidenceError(
            f"{name}: the board's squares are below {_SMALLEST_SQUARE_PX:g} px; go nearer"
        )
    return BoardView(_refined(grey, px, mm, board), mm, name)


def _grey8(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    shallow = pixels if pixels.dtype == np.uint8 else (pixels >> 8).astype(np.uint8)
    grey = shallow if shallow.ndim == 2 else cv2.cvtColor(shallow, cv2.COLOR_BGR2GRAY)
    return np.ascontiguousarray(grey, dtype=np.uint8)


def _chessboard(grey: NDArray[np.uint8], board: Board) -> tuple[Points, Points] | None:
    """Inner corners; many people count these where squares are asked for, so both are tried."""
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    for inner in ((board.columns - 1, board.rows - 1), (board.columns, board.rows)):
        done, corners = cv2.findChessboardCornersSB(grey, inner, flags=flags)
        if not done:
            done, corners = cv2.findChessboardCorners(grey, inner)
        if done:
            column, row = np.meshgrid(np.arange(inner[0]), np.arange(inner[1]))
            mm = board.square_mm * np.column_stack([column.ravel(), row.ravel()])
            return np.asarray(corners, dtype=np.float64).reshape(-1, 2), mm.astype(np.float64)
    return None


def _charuco(grey: NDArray[np.uint8], board: Board) -> tuple[Points, Points] | None:
    """The better of both layouts: boards of OpenCV before 4.6 begin with the other colour."""
    found = [_charuco_corners(grey, board, legacy) for legacy in (False, True)]
    best = max(found, key=lambda pair: len(pair[0]))
    return best if len(best[0]) >= FEWEST_CORNERS else None


def _charuco_corners(grey: NDArray[np.uint8], board: Board, legacy: bool) -> tuple[Points, Points]:
    number = getattr(cv2.aruco, board.dictionary, None)
    if not isinstance(number, int):
        raise UsageError(f"{board.dictionary!r} is no dictionary of ArUco, such as DICT_4X4_50")
    dictionary = cv2.aruco.getPredefinedDictionary(number)
    assert board.marker_mm is not None
    size = (board.columns, board.rows)
    printed = cv2.aruco.CharucoBoard(size, board.square_mm, board.marker_mm, dictionary)
    printed.setLegacyPattern(legacy)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(printed).detectBoard(grey)
    if ids is None or not len(ids):
        return np.empty((0, 2)), np.empty((0, 2))
    places = np.asarray(printed.getChessboardCorners(), dtype=np.float64)[:, :2]
    return np.asarray(corners, dtype=np.float64).reshape(-1, 2), places[np.ravel(ids)]


def _square_px(px: Points, mm: Points, board: Board) -> float:
    """Side of a square in px: the least distance of neighbouring corners, over all corners."""
    apart = np.hypot(*(mm[:, None] - mm[None]).transpose(2, 0, 1))
    neighbours = np.abs(apart - board.square_mm) < 1e-6 * board.square_mm
    if not neighbours.any():
        return float("inf")
    return float(np.median(np.hypot(*(px[:, None] - px[None]).transpose(2, 0, 1))[neighbours]))


def _refined(grey: NDArray[np.uint8], px: Points, mm: Points, board: Board) -> Points:
    """Corners moved to where all gradients around them meet; those that would jump stay.

    The window stays clear of a ChArUco board's markers, whose gradients meet elsewhere.
    """
    square_px = _square_px(px, mm, board)
    free = 0.3 if board.marker_mm is None else 0.4 * (1 - board.marker_mm / board.square_mm)
    reach = int(np.clip(free * square_px, 2, 15))
    start = px.astype(np.float32).reshape(-1, 1, 2)
    moved = cv2.cornerSubPix(grey, start.copy(), (reach, reach), (-1, -1), _STEPS).reshape(-1, 2)
    jumped = np.hypot(*(moved - px).T) > 1.5
    return np.asarray(np.where(jumped[:, None], px, moved), dtype=np.float64)
