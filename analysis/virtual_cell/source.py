"""The source `virtual-cell`: one identification run and one weld, faster than real time."""

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from seamlog.clock import SimulatedClock
from seamlog.contracts import Pace, Sink, SourceResult

if TYPE_CHECKING:
    from .journal import MovedClock

Fault = Literal["speed_dip", "dropouts", "clock_step", "seam_jump"]


class VirtualCellConfig(BaseModel):
    """What to weld and what goes wrong."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed: int = Field(1, ge=0)
    identification_s: float = Field(20.0, ge=10.0, le=600.0)
    """Length of the identification run, 100 sin(t) mm."""
    speed_mm_s: float = Field(6.0, ge=2.0, le=15.0)
    """Travel of the robot while welding."""
    faults: tuple[Fault, ...] = ("speed_dip",)
    """speed_dip: the robot slows to 60 % near s = 120 mm for 2.5 s; dropouts: encoder messages and
    pictures are missing at times; clock_step: the camera's clock jumps by 0.35 s during the weld;
    seam_jump: the plate slips by 2 mm during the weld."""


class VirtualCell:
    """The weld cell with its live loop; `clock` may be replaced before `run` to pace it."""

    Config = VirtualCellConfig
    pace: Pace = "simulated"

    def __init__(self, config: VirtualCellConfig) -> None:
        self.config = config
        self.clock: MovedClock = SimulatedClock()

    def run(self, sink: Sink) -> SourceResult:
        """Weld once; hands over the photo of the bead and its calibration."""
        from .cell import Cell

        streams = np.random.SeedSequence(self.config.seed).spawn(8)
        return Cell(self.config, sink, self.clock, streams).run()
