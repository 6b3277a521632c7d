"""What the seam finder and the marker finder report of a picture: true places with their errors.

The pictures are rendered from the same truth, but not read back: points come with the noise,
outliers and blind spots (torch, arc, fresh bead) that a finder has on such pictures.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .seam import MARGIN_MM, WELD_LENGTH_MM, TrueSeam
from .view import HEIGHT_PX, MARKER_X_MM, WIDTH_PX, px_of

Floats = NDArray[np.float64]

POINT_NOISE_PX = 0.7
OUTLIER_SHARE = 0.03
MARKER_NOISE_PX = 0.15
_SPACING_MM = 5.0
_TORCH_HALF_MM = 12.0
_GLARE_MM = 24.0


@dataclass(frozen=True, slots=True)
class Scene:
    """The cell at one exposure: table travel, torch, arc, and how far the bead reaches."""

    time_s: float
    travel_mm: float
    torch_y_mm: float
    arc_on: bool
    bead_end_mm: float
    """y up to which metal lies on the seam; below 0 before the arc."""
    slip_mm: float = 0.0
    """How far the plate has slipped on the table."""


class Vision:
    """The finders, with their own noise."""

    def __init__(self, seam: TrueSeam, rng: np.random.Generator) -> None:
        self._seam, self._rng = seam, rng

    def seam_points(self, scene: Scene) -> tuple[Floats, Floats]:
        """Columns and rows of the seam points found, px."""
        y = np.arange(_SPACING_MM - MARGIN_MM, WELD_LENGTH_MM + MARGIN_MM, _SPACING_MM)
        y = y[self._is_seen(y, scene)]
        x = self._seam.x_mm(y) + scene.slip_mm + scene.travel_mm
        points = px_of(x, y)
        points[:, 1] += POINT_NOISE_PX * self._rng.standard_normal(len(y))
        points[:, 0] += 0.2 * self._rng.standard_normal(len(y))
        wild = self._rng.random(len(y)) < OUTLIER_SHARE
        points[wild, 1] += self._rng.uniform(5.0, 15.0, int(wild.sum())) * self._rng.choice([-1, 1])
        inside = (points[:, 0] > 2) & (points[:, 0] < WIDTH_PX - 2)
        inside &= (points[:, 1] > 2) & (points[:, 1] < HEIGHT_PX - 2)
        return points[inside, 0], points[inside, 1]

    def _is_seen(self, y_mm: Floats, scene: Scene) -> NDArray[np.bool_]:
        hidden = np.abs(y_mm - scene.torch_y_mm) < _TORCH_HALF_MM
        if scene.arc_on:
            hidden |= np.abs(y_mm - scene.torch_y_mm) < _GLARE_MM
        hidden |= (y_mm > -3.0) & (y_mm < scene.bead_end_mm + 3.0) & (scene.bead_end_mm > 0.0)
        return ~hidden

    def marker(self, scene: Scene) -> tuple[float, float]:
        """Column and row of the marker on the torch, px."""
        found = px_of(MARKER_X_MM, scene.torch_y_mm)[0]
        found = found + MARKER_NOISE_PX * self._rng.standard_normal(2)
        return float(found[0]), float(found[1])
