"""Identified values beside published ones, the difference in standard deviations."""

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from seamlog.errors import ConfigError, InputError

from .friction_models import Friction
from .method import Identification


class ReferenceValue(BaseModel):
    """One published value with its standard deviation, if one was published."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: float
    sd: float | None = None
    unit: str = ""


class Reference(BaseModel):
    """Published identifications by friction model; `source` says where they stand."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    source: str
    symmetric: dict[str, ReferenceValue] = {}
    asymmetric: dict[str, ReferenceValue] = {}

    def values(self, friction: Friction) -> dict[str, ReferenceValue]:
        """The table of one friction model."""
        known = {"symmetric": self.symmetric, "asymmetric": self.asymmetric}
        return known.get(friction, {})


@dataclass(frozen=True)
class Comparison:
    """One row: `difference_sd` is the difference over the joint standard deviation."""

    name: str
    identified: float
    identified_sd: float | None
    published: float
    published_sd: float | None
    difference_sd: float | None


def load_reference(path: Path) -> Reference:
    """Read a reference file (TOML); `ConfigError` lists every fault."""
    try:
        return Reference.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such reference file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not valid TOML: {error}") from error
    except ValidationError as error:
        faults = tuple(
            ".".join(str(part) for part in item["loc"]) + f": {item['msg']}"
            for item in error.errors()
        )
    listed = "\n".join(f"  {fault}" for fault in faults)
    raise ConfigError(f"{path} is no reference file:\n{listed}", faults)


def compare(found: Identification, reference: Reference) -> list[Comparison]:
    """Rows for what both have; `ConfigError` if that is nothing.

    Deviations are those of a white residual on both sides: that is what is published.
    """
    fit = found.fit
    own: dict[str, tuple[float, float | None]] = {
        name: (value, sd)
        for name, value, sd in zip(
            fit.names, fit.values.tolist(), fit.white_sd.tolist(), strict=True
        )
    }
    own["condition_number"] = (fit.condition_number, None)
    own["residual_norm"] = (fit.residual_norm, None)
    own["relative_error"] = (100 * fit.relative_error, None)
    published = reference.values(found.friction)
    rows = [_row(name, *own[name], published[name]) for name in published if name in own]
    if not rows:
        raise ConfigError(
            f"the reference has nothing for {found.friction} friction; it may name "
            f"{', '.join(own)} in a table [{found.friction}]"
        )
    return rows


def _row(name: str, value: float, sd: float | None, published: ReferenceValue) -> Comparison:
    joint = math.hypot(sd or 0.0, published.sd or 0.0)
    difference = (value - published.value) / joint if joint > 0 else None
    return Comparison(name, value, sd, published.value, published.sd, difference)
