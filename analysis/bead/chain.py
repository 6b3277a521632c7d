"""Dynamic programming: the smooth chain of columns, one per row, that gathers the most evidence."""

import numpy as np
from numpy.typing import NDArray


def best_chain(score: NDArray[np.float32], move_cost: float) -> NDArray[np.int64]:
    """Column per row of `score` (rows, columns), moving at most one column per row.

    -inf in `score` marks forbidden places.
    """
    return np.asarray(best_chains(score[None], move_cost)[0])


def best_chains(score: NDArray[np.float32], move_cost: float) -> NDArray[np.int64]:
    """As `best_chain` for several scores (n, rows, columns) at once, shape (n, rows)."""
    count, rows, columns = score.shape
    values = np.full((rows, count, columns + 2), -np.inf, dtype=np.float32)
    values[:, :, 1:-1] = np.swapaxes(score, 0, 1)
    cost = np.float32(move_cost)
    flat = values.reshape(len(values), -1)
    less, same, more = flat[:, :-2], flat[:, 1:-1], flat[:, 2:]
    best = np.empty_like(same[0])
    for below, at, above, now in zip(less[:-1], same[:-1], more[:-1], same[1:], strict=True):
        np.maximum(below, above, out=best)
        np.subtract(best, cost, out=best)
        np.maximum(best, at, out=best)
        np.add(now, best, out=now)
    return _walked_back(values, cost)


def _walked_back(values: NDArray[np.float32], cost: np.float32) -> NDArray[np.int64]:
    """The chains that end best; `values` (rows, n, columns + 2) gather the most up to a place."""
    before = values[:-1]
    same, less, more = before[..., 1:-1], before[..., :-2] - cost, before[..., 2:] - cost
    came = (more > np.maximum(same, less)).astype(np.int8)
    came -= (less > same) & (less >= more)
    moves = memoryview(came)
    path = np.empty((values.shape[1], len(values)), dtype=np.int64)
    for chain, column in enumerate(np.argmax(values[-1, :, 1:-1], axis=1).tolist()):
        columns = [column]
        for row in range(len(came) - 1, -1, -1):
            columns.append(columns[-1] + moves[row, chain, columns[-1]])
        path[chain] = columns[::-1]
    return path
