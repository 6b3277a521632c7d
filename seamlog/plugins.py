"""Finding plug-ins by name: one mechanism for our own and for others, lazy, by entry points."""

import difflib
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from seamlog.errors import UnknownName, UsageError

GROUPS = (
    "seamlog.commands",
    "seamlog.controllers",
    "seamlog.estimators",
    "seamlog.seam_detectors",
    "seamlog.bead_detectors",
    "seamlog.sources",
    "seamlog.decoders",
    "seamlog.importers",
    "seamlog.sections",
)


@cache
def available(group: str) -> dict[str, EntryPoint]:
    """Entry points of `group` by name; two of one name are an error that names both."""
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=group):
        other = found.setdefault(entry.name, entry)
        if other.value != entry.value:
            raise UsageError(
                f"two plug-ins are called {entry.name!r} in {group}: {other.value} and "
                f"{entry.value}; uninstall one of them"
            )
    return found


def load(group: str, name: str) -> Any:
    """Load the plug-in `name` of `group`; an unknown name lists the known ones."""
    known = available(group)
    if name not in known:
        raise UnknownName(unknown_name(group.removeprefix("seamlog."), name, list(known)))
    return known[name].load()


def unknown_name(kind: str, name: str, known: list[str]) -> str:
    """The message for a name that is not there, with the nearest one that is."""
    near = difflib.get_close_matches(name, known, 1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    listed = ", ".join(sorted(known)) or "none"
    return f"no {kind.rstrip('s')} is called {name!r}.{hint} Known: {listed}"
