"""Studies of a gauge: from a table of photos or values, or from repeat photos of one bead."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from seamlog.analysis.bead.image import Photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.stitch import backwards, find_overlap
from seamlog.errors import EvidenceError, InputError, UsageError

Floats = NDArray[np.float64]

PART_MM = 5.0
"""Length of bead that counts as a part, where the parts are places along one bead."""


@dataclass(frozen=True, slots=True)
class Study:
    """Values of shape (parts, operators, trials) in `unit`, with the names of both."""

    values: Floats
    parts: tuple[str, ...]
    operators: tuple[str, ...]
    unit: str
    what: str


@dataclass(frozen=True, slots=True)
class Trial:
    """One row of a study: a photo to measure, or the value itself."""

    part: str
    operator: str
    photo: Path | None
    value: float | None


def read_study(path: Path) -> list[Trial]:
    """Rows of a CSV with columns part, operator (optional), and photo or width_mm.

    Photos are named relative to the table. Raises `InputError`.
    """
    try:
        table = pd.read_csv(path, dtype=str, skipinitialspace=True)
    except (OSError, UnicodeDecodeError, pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise InputError(f"{path} is no table of a study: {error}") from error
    table.columns = [str(name).strip() for name in table.columns]
    source = next((name for name in ("photo", "width_mm") if name in table.columns), None)
    if "part" not in table.columns or source is None:
        raise InputError(
            f"{path} has the columns {', '.join(table.columns)}; needed are part, and photo or "
            "width_mm, and operator if there were several"
        )
    if table[["part", source]].isna().any().any():
        raise InputError(f"{path} has rows without part or {source}")
    return [_trial(path, row, source) for row in table.to_dict("records")]


def _trial(path: Path, row: Mapping[Hashable, Any], source: str) -> Trial:
    operator = row.get("operator")
    name = operator if isinstance(operator, str) else "1"
    if source == "photo":
        return Trial(row["part"], name, path.parent / row["photo"], None)
    try:
        return Trial(row["part"], name, None, float(row["width_mm"]))
    except ValueError as error:
        raise InputError(f"{path}: width_mm {row['width_mm']!r} is no number") from error


def crossed(trials: Sequence[Trial], values: Sequence[float], unit: str) -> Study:
    """Rows to a full cross of parts, operators, trials; `EvidenceError` where cells lack some."""
    parts = tuple(dict.fromkeys(trial.part for trial in trials))
    operators = tuple(dict.fromkeys(trial.operator for trial in trials))
    cells: dict[tuple[str, str], list[float]] = {(p, o): [] for p in parts for o in operators}
    for trial, value in zip(trials, values, strict=True):
        cells[trial.part, trial.operator].append(value)
    counts = {len(cell) for cell in cells.values()}
    if len(counts) != 1:
        least = min(cells, key=lambda cell: len(cells[cell]))
        raise EvidenceError(
            f"the study is not crossed: part {least[0]} by operator {least[1]} has "
            f"{len(cells[least])} trials, others have {max(counts)}; every operator has to measure "
            "every part equally often"
        )
    array = np.array([[cells[p, o] for o in operators] for p in parts], dtype=np.float64)
    return Study(array, parts, operators, unit, "mean width of each bead")


def places_along(measured: Sequence[BeadMeasurement], photos: Sequence[Photo]) -> Study:
    """Repeat photos of one bead as a study: the parts are stretches of it, 5 mm long.

    Photos from other places are laid over the first; without calibration all have to be taken from
    one place. Raises `EvidenceError` where that cannot be done.
    """
    if len(measured) < 2:
        raise UsageError("one photo repeats nothing; give two or more of the same bead")
    unit = measured[0].unit
    if any(m.unit != unit for m in measured):
        raise EvidenceError("some photos have a calibration and others have none")
    length = PART_MM if unit == "mm" else float(np.nanmedian(measured[0].width))
    shifted = [(measured[0], 0.0), *(_laid(measured, photos, k) for k in range(1, len(measured)))]
    start = max(shift for _, shift in shifted)
    stop = min(float(m.s[-1]) + shift for m, shift in shifted)
    edges = np.arange(start, stop + 1e-9, length)
    if len(edges) < 3:
        raise EvidenceError("the photos have too little of the bead in common")
    means = np.array([_means(m, m.s + shift, edges) for m, shift in shifted])
    known = np.isfinite(means).all(axis=0)
    if known.sum() < 2:
        raise EvidenceError("no two stretches were measured on all photos")
    names = tuple(f"{edge:.0f} {unit}" for edge in edges[:-1][known])
    values = means[:, known].T[:, None, :]
    return Study(values, names, ("1",), unit, f"mean width of stretches of {length:.3g} {unit}")


def _laid(
    measured: Sequence[BeadMeasurement], photos: Sequence[Photo], k: int
) -> tuple[BeadMeasurement, float]:
    if measured[0].unit != "mm":
        return measured[k], 0.0
    overlap = find_overlap(measured[0], measured[k], (photos[0], photos[k]))
    return (backwards(measured[k]) if overlap.backwards else measured[k]), overlap.shift


def _means(m: BeadMeasurement, s: Floats, edges: Floats) -> Floats:
    """Mean width in each stretch; NaN where less than half of it was measured."""
    place = np.digitize(s, edges) - 1
    means = np.full(len(edges) - 1, np.nan)
    for part in range(len(means)):
        inside = place == part
        good = inside & m.good
        if good.sum() >= max(2, 0.5 * inside.sum()):
            means[part] = m.width[good].mean()
    return means
