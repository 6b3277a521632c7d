"""Rows of a standard as a table in a file, and the limit that a row gives for this weld."""

import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from seamlog.errors import ConfigError, InputError

Level = Literal["B", "C", "D"]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid")


class LevelLimit(_Model):
    """`plus + factor * of`, at most `most`, mm; not `permitted` allows none at all."""

    permitted: bool = True
    plus: float = 0.0
    factor: float = 0.0
    of: Literal["t", "s", "b"] | None = None
    most: float | None = None


class Row(_Model):
    """One imperfection; `figure` names the measured figure it is compared with."""

    number: str
    name: str
    figure: str
    weld: Literal["butt", "fillet"] | None = None
    thicker_than_mm: float | None = None
    levels: dict[Level, LevelLimit]


class Standard(_Model):
    """A table of rows and where they come from."""

    source: str
    row: list[Row] = Field(min_length=1)


class Sizes(_Model):
    """What limits depend on, mm: plate t, penetration s, bead b; None is not known."""

    t: float | None = None
    s: float | None = None
    b: float | None = None


def load_standard(path: Path | None = None) -> Standard:
    """The user's table, or the verified rows of ISO 5817 that are shipped."""
    name = str(path) if path else "iso5817.toml"
    try:
        text = (path or files(__package__).joinpath("iso5817.toml")).read_text(encoding="utf-8")
        return Standard.model_validate(tomllib.loads(text))
    except FileNotFoundError as error:
        raise InputError(f"{name}: no such table of limits; check `quality.table`") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{name} is not valid TOML: {error}") from error
    except ValidationError as error:
        faults = tuple(
            ".".join(str(part) for part in item["loc"]) + f": {item['msg']}"
            for item in error.errors()
        )
        raise ConfigError(f"{name} is no table of limits:\n  " + "\n  ".join(faults)) from error


_SIZES = {
    "t": "the plate's thickness (quality.plate_thickness_mm)",
    "s": "the penetration thickness (quality.penetration_thickness_mm)",
    "b": "the bead's width in mm",
}


def limit_mm(row: Row, level: Level, sizes: Sizes) -> tuple[float | None, str]:
    """Upper limit in mm of a row, or None and the reason why there is none for this weld."""
    limit = row.levels.get(level)
    if limit is None:
        return None, f"the table has no level {level} for it"
    if row.thicker_than_mm is not None:
        if sizes.t is None:
            return None, f"{_SIZES['t']} is not given"
        if sizes.t <= row.thicker_than_mm:
            return None, f"the row holds for plates thicker than {row.thicker_than_mm:g} mm"
    if not limit.permitted:
        return 0.0, ""
    size = getattr(sizes, limit.of) if limit.of else 0.0
    if size is None:
        return None, f"{_SIZES[limit.of or 't']} is not known"
    value = limit.plus + limit.factor * float(size)
    return (value if limit.most is None else min(value, limit.most)), ""
