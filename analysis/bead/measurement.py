"""What a bead detector gives back, and what every bead detector is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .image import Photo
from .plane import Plane, Points

Floats = NDArray[np.float64]

TOES = {
    "metal": "metal: where the look of the weld metal ends; slag and lines beside it are outside",
    "outer": "outer: where the look of the clean plate begins; slag and lines beside it are inside",
}
"""Toe definitions by the name of the option. Two honest readers of a photo differ by this."""
END = "end of the bead"
"""Reason of the stations at a start or stop, where the bead is round and has no width."""


@dataclass(frozen=True, slots=True)
class BeadMeasurement:
    """Bead width at stations along the bead; lengths in `unit` (`mm`, or `px` uncalibrated).

    Arrays have one entry per station. `s` is arc length from the bead's start in the photo (see
    `starts_at`); `width` and `u_width` are NaN where no toe was seen; `u_noise` is the random part
    of `u_width`. `left_px`, `right_px`, `centre_px` have shape (n, 2): x, y in the photo. A flagged
    station carries its `reason`. `confidence` is 0 to 1; `tint` how much speaks for a heat tint
    around the bead instead of the bead, 0 to 1. `starts_at` is the end of the photo that
    s = 0 lies at, `direction_known` whether somebody said so; `open_start` and `open_stop` tell
    that the bead runs out of the frame there.
    """

    unit: str
    s: Floats
    width: Floats
    u_width: Floats
    u_noise: Floats
    left_px: Points
    right_px: Points
    centre_px: Points
    flagged: NDArray[np.bool_]
    reason: Sequence[str]
    unit_per_px: float
    confidence: float
    warnings: tuple[str, ...]
    starts_at: str
    direction_known: bool
    open_start: bool
    open_stop: bool
    toe_definition: str = TOES["metal"]
    tint: float = 0.0

    @property
    def good(self) -> NDArray[np.bool_]:
        """Stations that have a width and no flag."""
        return ~self.flagged & np.isfinite(self.width)

    @property
    def trusted(self) -> bool:
        """Whether the mean width may be stated without a caveat."""
        return self.confidence >= TRUSTED


TRUSTED = 0.7
"""Confidence below which a width is printed as doubtful."""


class BeadDetector(Protocol):
    """Measures the bead in a photo; plug-ins of the group `seamlog.bead_detectors`."""

    def __call__(
        self,
        photo: Photo,
        plane: Plane,
        prior: Points | None = None,
        start: str | None = None,
        toe: str = "metal",
    ) -> BeadMeasurement:
        """Measure; `prior` is a path in the plane's unit, `start` left, right, top or bottom.

        `toe` is a key of `TOES`.

        Raises `EvidenceError` where no bead can be told from the plate.
        """
        ...
