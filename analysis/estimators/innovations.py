"""Variance of recursive least squares from its own prediction errors, which may look alike.

Each gap at rest leaves an error that fades with the filter, and what the model lacks repeats with
the stroke. So the errors are taken together in blocks, one per stretch of sliding (at most
`_BLOCK_ROWS` rows): the sandwich estimate for clustered errors, gain x sum(s s^T) x gain with
s the sum of the rows' scores over a block.
"""

import math

from .gain import Gain, Vector, diagonal_gain, reduced, times

_BLOCK_ROWS = 100
_LEAST_ROWS = 3
_LEAST_BLOCKS = 4


class Innovations:
    """Blocks of scores (regressor x weighted prediction error) since the start."""

    def __init__(self) -> None:
        self._skipped = self._rows = self._blocks = 0
        self._score: Vector = (0.0, 0.0, 0.0)
        self._spread: Gain = diagonal_gain((0.0, 0.0, 0.0))

    def add(self, regressor: Vector, error: float, kept: float) -> None:
        """Take a row's regressor and its error over the root of its normalised variance.

        `kept` is the factor by which the weight of all rows before has shrunk.
        """
        if self._skipped < _LEAST_ROWS:
            self._skipped += 1
            return
        s, w = self._score, regressor
        self._score = (
            kept * s[0] + w[0] * error,
            kept * s[1] + w[1] * error,
            kept * s[2] + w[2] * error,
        )
        if kept != 1.0:
            self._spread = reduced(self._spread, (0.0, 0.0, 0.0), 0.0, kept * kept)
        self._rows += 1
        if self._rows >= _BLOCK_ROWS:
            self.end_block()

    def end_block(self) -> None:
        """The stretch of sliding ended."""
        if self._rows == 0:
            return
        self._spread = reduced(self._spread, self._score, -1.0, 1.0)
        self._blocks += 1
        self._rows, self._score = 0, (0.0, 0.0, 0.0)

    def variances(self, gain: Gain) -> tuple[float, float, float]:
        """Of the three parameters; NaN before four blocks. `gain` x scores is the estimate."""
        if self._blocks < _LEAST_BLOCKS:
            return math.nan, math.nan, math.nan
        g11, g12, g13, g22, g23, g33 = gain
        few = self._blocks / (self._blocks - 3)
        rows: tuple[Vector, ...] = ((g11, g12, g13), (g12, g22, g23), (g13, g23, g33))
        a, b, c = (few * _quadratic(self._spread, row) for row in rows)
        return a, b, c


def _quadratic(matrix: Gain, row: Vector) -> float:
    along = times(matrix, row)
    return row[0] * along[0] + row[1] * along[1] + row[2] * along[2]
