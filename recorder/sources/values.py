"""From the values of a device's frame to the fields of a topic, as the configuration says."""

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, model_validator

from seamlog.channels import CHANNELS
from seamlog.messages import is_fixed

Frame = Mapping[str, float]
"""Values of one frame by name."""


class FieldValue(BaseModel):
    """A field of the message: `name` in the frame, times `scale`, plus `offset`; or `constant`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    constant: float | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> "FieldValue":
        if (self.name is None) == (self.constant is None):
            raise ValueError("give either name, that of the frame's value, or constant")
        return self

    def of(self, frame: Frame) -> float:
        """The value in SI units."""
        if self.name is None:
            return self.constant or 0.0
        return frame[self.name] * self.scale + self.offset


def _numeric(topic: str) -> str:
    if topic not in CHANNELS or not is_fixed(CHANNELS[topic]):
        known = ", ".join(name for name, row in CHANNELS.items() if is_fixed(row))
        raise ValueError(f"not a topic of numbers; there are: {known}")
    if any("[" in field.type for field in CHANNELS[topic].fields):
        raise ValueError("a topic of arrays cannot be filled value by value")
    return topic


NumericTopic = Annotated[str, AfterValidator(_numeric)]


def check_fields(topic: str, values: Mapping[str, FieldValue], names: tuple[str, ...]) -> None:
    """`ValueError` unless `values` are fields of `topic` made of what a frame of `names` holds."""
    fields = CHANNELS[topic].fields[1:]
    known = {field.name for field in fields}
    if wrong := sorted(set(values) - known):
        raise ValueError(f"{topic} has no field {', '.join(wrong)}; it has {', '.join(known)}")
    asked = {value.name for value in values.values() if value.name is not None}
    if missing := sorted(asked - set(names)):
        raise ValueError(f"a frame holds no {', '.join(missing)}; it holds {', '.join(names)}")
    for field in fields:
        if field.name not in values and not field.type.startswith("float"):
            raise ValueError(f"{topic} needs {field.name}; give its name or a constant")


def absent_fields(topic: str, values: Mapping[str, FieldValue]) -> dict[str, str]:
    """Channel metadata that lists the fields which the device does not tell."""
    absent = [name for name in CHANNELS[topic].field_names[1:] if name not in values]
    return {"absent": ",".join(absent)} if absent else {}


def field_reader(
    topic: str, values: Mapping[str, FieldValue]
) -> Callable[[Frame], tuple[Any, ...]]:
    """A function from a frame to the values of a message, NaN where the device tells nothing."""
    fields = CHANNELS[topic].fields[1:]
    rows = [(values.get(field.name), not field.type.startswith("float")) for field in fields]

    def read(frame: Frame) -> tuple[Any, ...]:
        return tuple(
            math.nan if value is None else round(value.of(frame)) if whole else value.of(frame)
            for value, whole in rows
        )

    return read
