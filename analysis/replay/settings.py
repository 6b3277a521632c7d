"""Section `replay` of the configuration."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Mode = Literal["shadow", "counterfactual", "both"]


class CheckSettings(BaseModel):
    """When a replayed value counts as the recorded one, for `--check-original`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    absolute: float = Field(1e-9, ge=0)
    """In the unit of the channel's field."""
    relative: float = Field(1e-9, ge=0)
    """Of the largest recorded value of the field."""
    time_s: float = Field(0.0, ge=0)
    """A value recorded this much earlier or later will do."""
    settle_s: float = Field(2.0, ge=0)
    """Left out after each hole in the record."""


class ReplaySettings(BaseModel):
    """Configurations by controller or estimator name, size and seed of the ensemble.

    A controller without a configuration here has that of the recorded one if it is the recorded
    one, else its own defaults on the identified axis.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    controllers: dict[str, dict[str, Any]] = {}
    estimators: dict[str, dict[str, Any]] = {}
    members: int = Field(24, ge=2, le=1000)
    """Runs of the ensemble behind each band."""
    seed: int = Field(0, ge=0)
    check: CheckSettings = CheckSettings()
