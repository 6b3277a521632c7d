"""`seamlog sources`: what can be recorded from here, and what is missing for it."""

from dataclasses import asdict
from typing import Any

import click

from seamlog import plugins
from seamlog.command import command, group
from seamlog.errors import SeamlogError, SourceMissing, UsageError
from seamlog.outcome import Outcome


@group(
    invoke_without_command=True,
    params=[click.Option(["--json"], is_flag=True, expose_value=False, help="Print JSON.")],
)
@click.pass_context
def sources(context: click.Context) -> Outcome | None:
    """List the sources that can be recorded, or probe one for its devices."""
    return None if context.invoked_subcommand else _list_sources()


@command("list")
def sources_list() -> Outcome:
    """Name, pace, and whether the source can be used here."""
    return _list_sources()


@command("probe")
@click.argument("name")
def sources_probe(name: str) -> Outcome:
    """Devices that source NAME finds here; exit code 4 without driver or device."""
    factory = plugins.load("seamlog.sources", name)
    _refuse_missing(name, factory)
    if not hasattr(factory, "probe"):
        raise UsageError(f"source {name} has no devices to look for; just record it")
    devices = factory.probe()
    if not devices:
        raise SourceMissing(f"source {name} works here, and no device is connected")
    wide = max(len(device.address) for device in devices)
    lines = [f"{device.address:<{wide}}  {device.description}" for device in devices]
    rows = [asdict(device) for device in devices]
    return Outcome("seamlog.sources.probe", "\n".join(lines), {"source": name, "devices": rows})


sources.add_command(sources_list)
sources.add_command(sources_probe)


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
    pace, missing = str(getattr(factory, "pace", "?")), "; ".join(_missing(factory))
    return {"name": name, "pace": pace, "available": not missing, "missing": missing}


def _missing(factory: Any) -> list[str]:
    return [d.advice for d in getattr(factory, "drivers", ()) if not d.is_installed]


def _refuse_missing(name: str, factory: Any) -> None:
    if missing := _missing(factory):
        raise SourceMissing(f"source {name}: {'; '.join(missing)}")
