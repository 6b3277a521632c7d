"""The replays of one results directory as results of their own, so that they can be compared."""

from pathlib import Path

from seamlog.errors import UsageError
from seamlog.results import Figure, Part, Results

_BASE = "recorded"
_LABELS = {"_rms_error_mm": "rms tracking error", "_peak_error_mm": "peak tracking error"}
"""Endings of a replay's figures, and what they are called in every replay."""


def replays_of(results: Results, folder: Path) -> list[Results]:
    """One directory in `folder` per replay, the recorded run first.

    Raises `UsageError` where there is nothing to set beside the record.
    """
    parts = [part for part in results.parts() if part.part == "replay"]
    names = [name for part in parts for name in part.tables if _is_run(part, name)]
    names = sorted(dict.fromkeys(names), key=lambda name: name != _BASE)
    if len(names) < 2 or names[0] != _BASE:
        raise UsageError(
            f"compare needs two results directories or more, the first being the base; or one with "
            f"replays, and {results.folder} holds none"
        )
    return [_alone(results, parts, name, folder / name) for name in names]


def _is_run(part: Part, name: str) -> bool:
    return "error_mm" in part.tables[name].columns


def _alone(results: Results, parts: list[Part], name: str, folder: Path) -> Results:
    found = Results.create(folder)
    for part in parts:
        if name not in part.tables:
            continue
        columns = {
            column: values
            for column, values in results.columns(part, name).items()
            if values.dtype.kind in "fiu"
        }
        kept = part.model_copy(
            update={"figures": _figures(part, name), "criteria": [], "findings": []}
        )
        found.write(kept, {"run": (columns, part.tables[name].columns)})
    return found


def _figures(part: Part, name: str) -> list[Figure]:
    """The replay's own figures, named as those of every other."""
    return [
        figure.model_copy(update={"name": ending[1:], "label": _LABELS[ending]})
        for ending in _LABELS
        if (figure := part.figure(name + ending)) is not None
    ]
