"""Section `sweep` of the configuration."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Kind = Literal["rms", "peak"]


class SweepSettings(BaseModel):
    """What is varied and how it is judged.

    `grid` has the values of a parameter, `ranges` its ends for `sobol` points; a parameter is
    called `name`, `outer.name` or, for one controller of several, `controller:name`. `controllers`
    has what stays fixed, by controller.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    grid: dict[str, list[Any]] = {}
    ranges: dict[str, tuple[float, float]] = {}
    sobol: int = Field(0, ge=0, le=10_000)
    """Points within `ranges`, for each point of the grid."""
    controllers: dict[str, dict[str, Any]] = {}
    figure: Kind = "rms"
    members: int = Field(24, ge=4, le=1000)
    """Runs of the ensemble behind each figure."""
    seed: int = Field(0, ge=0)
