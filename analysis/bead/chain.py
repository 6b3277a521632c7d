"""Dynamic programming: the smooth chain of columns, one per row, that gathers the most evidence."""

import numpy as np
from numpy.typing import NDArray


def best_chain(score: NDArray[np.float32], move_cost: float) -> NDArray[np.int64]:
    """Column per row of `score` (rows, columns), moving at most one column per row.

    -inf in `score` marks forbidden places; vectorised over the columns.
    """
    rows, columns = score.shape
    came = np.zeros((rows, columns), dtype=np.int8)
    value = score[0].copy()
    padded = np.full(columns + 2, -np.inf, dtype=np.float32)
    for row in range(1, rows):
        padded[1:-1] = value
        best = value.copy()
        for step in (-1, 1):
            other = padded[1 - step : 1 - step + columns] - np.float32(move_cost)
            better = other > best
            best[better] = other[better]
            came[row][better] = step
        value = best + score[row]
    path = np.empty(rows, dtype=np.int64)
    path[-1] = int(np.argmax(value))
    for row in range(rows - 1, 0, -1):
        path[row - 1] = path[row] - came[row, path[row]]
    return path
