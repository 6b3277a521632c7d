"""What the bead's tests share: rendered cases measured once."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane, plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import CASES, SyntheticBead, render

END_MM = 3.0


@dataclass(frozen=True)
class Measured:
    """A rendered bead, what was measured, and its error against the truth."""

    bead: SyntheticBead
    plane: Plane
    result: BeadMeasurement

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Stations well inside the picture."""
        x_mm = self.plane.to_plane(self.result.centre_px)[:, 0]
        return (x_mm > END_MM) & (x_mm < 102.4 - END_MM)

    @property
    def error_px(self) -> NDArray[np.float64]:
        """Width error at the stations inside, in units of 0.1 mm."""
        centre_mm = self.plane.to_plane(self.result.centre_px)
        true_mm = self.bead.width_at_mm(self.bead.seam_s_mm(centre_mm))
        return ((self.result.width - true_mm) / 0.1)[self.inside]


@cache
def measured_case(name: str, seed: int, with_path: bool) -> Measured:
    """Render a named case and measure it, along a wandering path or found in the picture."""
    bead = render(CASES[name], seed)
    photo = make_photo(bead.pixels, name)
    plane = plane_of(photo, bead.calibration)
    prior = bead.wandering_path(seed=seed) if with_path else None
    return Measured(bead, plane, measure_strip(photo, plane, prior))


@pytest.fixture(scope="session")
def measure_case() -> Callable[[str, int, bool], Measured]:
    """`measured_case`, as a fixture."""
    return measured_case
