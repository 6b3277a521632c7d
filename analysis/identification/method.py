"""What all identification methods share: what they are given and what they give back."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .friction_models import FloatArray, Friction
from .regression import Fit

Method = Literal["auto", "gated", "batch", "idim-ls", "idim-iv", "output-error", "open-loop"]
"""`output-error` in closed loop where the record tells the drive's law; `open-loop` never."""


@dataclass(frozen=True)
class Motion:
    """The motion an identification rests on, as the method itself sees it, row by row."""

    velocity_m_s: FloatArray
    acceleration_m_s2: FloatArray
    share: float
    """Part of the record's rows that could be used, 0 to 1."""


@dataclass(frozen=True)
class Rows:
    """A linear regression ready to solve; all of one length.

    `block` numbers rows whose errors may resemble each other: a stretch of sliding, or a second.
    `position_m` and `velocity_m_s` say where and how fast the axis was.
    """

    names: tuple[str, ...]
    regressor: FloatArray
    measured: FloatArray
    block: NDArray[np.int64]
    position_m: FloatArray
    velocity_m_s: FloatArray
    stamp_ns: NDArray[np.int64]


@dataclass(frozen=True)
class Identification:
    """Axis parameters in `unit` of force or command per SI, and what they rest on."""

    method: str
    friction: Friction
    fit: Fit
    rows: Rows
    motion: Motion
    unit: str
    delay_periods: int
    settings: dict[str, float | int | str]
    notes: tuple[str, ...] = ()
    """What was left out or added, for people."""
    extras: dict[str, Any] = field(default_factory=dict)
    """JSON-ready details of the method: servo, ripple, simulation."""

    @property
    def stamp_ns(self) -> NDArray[np.int64]:
        """Time of each row of the fit."""
        return self.rows.stamp_ns
