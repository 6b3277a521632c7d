"""`seamlog plugins`: what is pluggable, and what is installed."""

from seamlog.command import command
from seamlog.outcome import Outcome
from seamlog.plugins import GROUPS, available


@command()
def plugins() -> Outcome:
    """List what is pluggable."""
    found = {
        group: {name: entry.value for name, entry in sorted(available(group).items())}
        for group in GROUPS
    }
    lines = []
    for group, entries in found.items():
        lines.append(group)
        lines += [f"  {name:<18} {value}" for name, value in entries.items()] or ["  (none)"]
    return Outcome("seamlog.plugins", "\n".join(lines), {"groups": found})
