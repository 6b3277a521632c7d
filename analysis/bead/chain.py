"""Dynamic programming: the smooth chain of columns, one per row, that gathers the most evidence."""

import numpy as np
from numpy.typing import NDArray

from . import loops
from .loops import loaded


def best_chains(score: NDArray[np.float32], move_cost: float) -> NDArray[np.int64]:
    """Column per row of each of n scores, shape (n, rows), moving at most one column per row.

    `score`, (n, rows, columns), marks forbidden places by -inf. Chains are gathered from both ends
    at once, which takes half the steps, until they meet in the middle row.
    """
    found = (loaded(loops.chains) or _chains)(score, np.float32(move_cost))
    return np.asarray(found)


def _chains(score: NDArray[np.float32], cost: np.float32) -> NDArray[np.int64]:
    count, rows, columns = score.shape
    middle = (rows - 1) // 2
    values = np.zeros((rows - middle, 2, count, columns + 2), dtype=np.float32)
    values[..., [0, -1]] = -np.inf
    inner = values[..., 1:-1].swapaxes(0, 2)
    inner[:, 0, -1 - middle :] = score[:, : middle + 1]
    inner[:, 1, :-1] = score[:, :middle:-1]
    flat = values.reshape(len(values), -1)
    less, same, more = flat[:, :-2], flat[:, 1:-1], flat[:, 2:]
    best = np.empty_like(same[0])
    for below, at, above, now in zip(less[:-1], same[:-1], more[:-1], same[1:], strict=True):
        np.maximum(below, above, out=best)
        np.subtract(best, cost, out=best)
        np.maximum(best, at, out=best)
        np.add(now, best, out=now)
    return _walked_back(values, cost)[:, -rows:]


def _walked_back(values: NDArray[np.float32], cost: np.float32) -> NDArray[np.int64]:
    """The chains that meet best in the last of `values` (rows, 2, n, columns + 2)."""
    before = values[:-1]
    same, less, more = before[..., 1:-1], before[..., :-2] - cost, before[..., 2:] - cost
    came = (more > np.maximum(same, less)).astype(np.int8)
    came -= (less > same) & (less >= more)
    moves = memoryview(came)

    def walked(side: int, chain: int, column: int) -> list[int]:
        columns = [column]
        for row in range(len(came) - 1, -1, -1):
            columns.append(columns[-1] + moves[row, side, chain, columns[-1]])
        return columns

    ends = values[-1].sum(axis=0)[:, 1:-1].argmax(axis=1).tolist()
    pairs = ((walked(0, *end), walked(1, *end)) for end in enumerate(ends))
    return np.array([back[::-1] + on[1:] for back, on in pairs])
