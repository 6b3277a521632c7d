"""What all content of a report is: frozen, checked, and dumped into the JSON twin."""

from pydantic import BaseModel, ConfigDict


class Block(BaseModel):
    """Something in a section, from top to bottom."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)
