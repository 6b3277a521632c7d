"""Dynamic programming: the smooth chain of columns, one per row, that gathers the most evidence."""

import numpy as np
from numpy.typing import NDArray


def best_chain(score: NDArray[np.float32], move_cost: float) -> NDArray[np.int64]:
    """Column per row of `score` (rows, columns), moving at most one column per row.

    -inf in `score` marks forbidden places.
    """
    return best_chains(score[None], move_cost)[0]


def best_chains(score: NDArray[np.float32], move_cost: float) -> NDArray[np.int64]:
    """As `best_chain` for several scores (n, rows, columns) at once, shape (n, rows)."""
    count, rows, columns = score.shape
    values = np.full((rows, count, columns + 2), -np.inf, dtype=np.float32)
    values[0, :, 1:-1] = score[:, 0]
    cost = np.float32(move_cost)
    moved = np.empty((count, columns), dtype=np.float32)
    for row in range(1, rows):
        before, now = values[row - 1], values[row, :, 1:-1]
        np.maximum(before[:, :-2], before[:, 2:], out=moved)
        moved -= cost
        np.maximum(moved, before[:, 1:-1], out=now)
        now += score[:, row]
    return _walked_back(values, cost)


def _walked_back(values: NDArray[np.float32], cost: np.float32) -> NDArray[np.int64]:
    """The chains that end best; `values` (rows, n, columns + 2) gather the best up to each place."""
    rows, count = values.shape[:2]
    every = np.arange(count)
    column = np.argmax(values[-1], axis=1)
    path = np.empty((count, rows), dtype=np.int64)
    path[:, -1] = column - 1
    for row in range(rows - 2, -1, -1):
        around = values[row][every[:, None], column[:, None] + (0, -1, 1)]
        around[:, 1:] -= cost
        column = column + np.array((0, -1, 1))[np.argmax(around, axis=1)]
        path[:, row] = column - 1
    return path
