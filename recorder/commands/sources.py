"""`seamlog sources`: what can be recorded from, and what is missing for it."""

from typing import Any

import click

from seamlog import plugins
from seamlog.command import command, group
from seamlog.errors import SeamlogError
from seamlog.outcome import Outcome


@group(
    invoke_without_command=True,
    params=[click.Option(["--json"], is_flag=True, expose_value=False, help="Print JSON.")],
)
@click.pass_context
def sources(context: click.Context) -> Outcome | None:
    """List the sources that can be recorded."""
    return None if context.invoked_subcommand else _list_sources()


@command("list")
def sources_list() -> Outcome:
    """Name, pace, and whether the source can be used here."""
    return _list_sources()


sources.add_command(sources_list)


def _list_sources() -> Outcome:
    rows = [_source(name) for name in sorted(plugins.available("seamlog.sources"))]
    wide = max((len(row["name"]) for row in rows), default=0)
    lines = [f"{row['name']:<{wide}}  {row['pace']:<9}  {_state(row)}" for row in rows]
    return Outcome("seamlog.sources", "\n".join(lines) or "no sources", {"sources": rows})


def _state(row: dict[str, Any]) -> str:
    return "available" if row["available"] else f"missing: {row['missing']}"


def _source(name: str) -> dict[str, Any]:
    try:
        factory = plugins.load("seamlog.sources", name)
    except (ImportError, AttributeError, SeamlogError) as error:
        return {"name": name, "pace": "?", "available": False, "missing": str(error)}
    pace = str(getattr(factory, "pace", "?"))
    return {"name": name, "pace": pace, "available": True, "missing": ""}
