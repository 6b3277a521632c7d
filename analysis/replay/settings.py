"""Section `replay` of the configuration."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Mode = Literal["shadow", "counterfactual", "both"]


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
