"""`seamlog record` and `seamlog sources`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog import plugins
from seamlog.channels import CHANNELS
from seamlog.command import command, config_options, force_option, group, output_option
from seamlog.errors import SeamlogError, UsageError
from seamlog.outcome import Ending, Outcome

from .importers.command import import_

if TYPE_CHECKING:
    from .accounts import Account
    from .session_run import Run

__all__ = ["import_", "record", "sources"]


@command()
@click.option("--source", "name", required=True, help="A source that 'seamlog sources' lists.")
@output_option("The session to write, such as weld.mcap.")
@config_options
@click.option("--meta", multiple=True, metavar="KEY=VALUE", help="Into the session's metadata.")
@click.option("--pace", type=click.Choice(["realtime"]), help="Hold a simulated source to time.")
@click.option("--duration", type=click.FloatRange(min=0, min_open=True), help="End after S s.")
@force_option
def record(
    name: str,
    output: Path,
    config: Path | None,
    settings: tuple[str, ...],
    meta: tuple[str, ...],
    pace: str | None,
    duration: float | None,
    force: bool,
) -> Outcome:
    """Record a live source into a session; Ctrl-C ends the recording and finishes the file."""
    from seamlog.config import load_config
    from seamlog.files import check_output

    values = _read_meta(meta)
    factory = plugins.load("seamlog.sources", name)
    check_output(output, force)
    source = factory(load_config(factory.Config, "source", config, settings))

    from .session_run import run_source

    run = run_source(source, output, values, pace == "realtime", duration, force)
    ending = Ending.PASS if run.status.is_complete else Ending.FINDING
    return Outcome("seamlog.record", _text(run, output), _document(run), ending)


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


def _read_meta(pairs: Sequence[str]) -> dict[str, str]:
    found = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key.strip():
            raise UsageError(f"--meta {pair!r}: write it as key=value")
        found[key.strip()] = value
    return found


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


def _document(run: "Run") -> dict[str, Any]:
    from .accounts import ACKNOWLEDGEMENT, account_document

    return {
        "path": run.status.path,
        "recording_id": run.status.recording_id,
        "ended": run.ending,
        "complete": run.status.is_complete,
        "findings": list(run.status.findings),
        "channels": [account_document(row) for row in run.status.channels],
        "files": [str(path) for path in run.files],
        "acknowledgement": dict(ACKNOWLEDGEMENT),
    }


def _text(run: "Run", output: Path) -> str:
    from .accounts import ACKNOWLEDGEMENT

    written = sum(row.written for row in run.status.channels)
    lines = [f"{output}: {written} messages; {run.ending}"]
    lines += [f"{path}: written by the source" for path in run.files]
    wide = max((len(row.topic) for row in run.status.channels), default=5)
    lines += [f"  {'topic':<{wide}}  {'written':>9} {'dropped':>8} {'refused':>8}  longest gap"]
    lines += [f"  {row.topic:<{wide}}  {_counts(row)}" for row in run.status.channels]
    lines += [f"  {finding}" for finding in run.status.findings]
    lines += [_verdict(run), "What an acknowledgement survives:"]
    return "\n".join(lines + [f"  {level}: {text}" for level, text in ACKNOWLEDGEMENT])


def _counts(row: "Account") -> str:
    steady = CHANNELS[row.topic].rate_hz is not None
    gap = f"{row.longest_gap_s:.3f} s" if steady and row.longest_gap_s is not None else "-"
    counts = f"{row.written:>9} {row.dropped:>8} {row.refused:>8}  {gap}"
    return f"{counts}  ({row.reason})" if row.reason else counts


def _verdict(run: "Run") -> str:
    rows = run.status.channels
    if run.status.is_complete:
        return "Complete: every message that the source offered is in the session."
    dropped, refused, lost = (
        sum(getattr(row, name) for row in rows) for name in ("dropped", "refused", "lost")
    )
    return f"INCOMPLETE: {dropped} dropped, {refused} refused, {lost} lost."
