"""`seamlog record`: a live source into a session."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from seamlog import plugins
from seamlog.command import command, config_options, force_option, output_option
from seamlog.errors import UsageError
from seamlog.outcome import Ending, Outcome

from .record_outcome import record_outcome
from .storage_options import storage_options

if TYPE_CHECKING:
    from seamlog.recorder.storage import Snapshot, Storage


@command()
@click.option("--source", "name", help="A source that 'seamlog sources' lists.")
@click.option("--listen", metavar="ADDRESS", help="A loop elsewhere, such as tcp://127.0.0.1:5577.")
@output_option("The session to write, such as weld.mcap.")
@config_options
@click.option("--meta", multiple=True, metavar="KEY=VALUE", help="Into the session's metadata.")
@click.option("--pace", type=click.Choice(["realtime"]), help="Hold a simulated source to time.")
@click.option("--duration", type=click.FloatRange(min=0, min_open=True), help="End after S s.")
@click.option("--live", metavar="[HOST:]PORT", help="Show it in Foxglove meanwhile.")
@click.option("--compact", is_flag=True, help="Then write it in large chunks too (.compact.mcap).")
@storage_options
@force_option
def record(
    name: str | None,
    listen: str | None,
    output: Path,
    config: Path | None,
    settings: tuple[str, ...],
    meta: tuple[str, ...],
    pace: str | None,
    duration: float | None,
    live: str | None,
    compact: bool,
    storage: "Storage",
    snapshot: "Snapshot | None",
    force: bool,
) -> Outcome:
    """Record a live source into a session; Ctrl-C or SIGTERM ends it and finishes the file."""
    from seamlog.config import load_config
    from seamlog.files import check_output

    values = _read_meta(meta)
    if (name is None) == (listen is None):
        raise UsageError("give either --source or --listen")
    if listen is not None:
        settings = (*settings, f"source.address={listen}")
    factory = plugins.load("seamlog.sources", name or "listen")
    check_output(output, force)
    if compact:
        check_output(_compacted(output), force)
    source = factory(load_config(factory.Config, "source", config, settings))
    if live is not None:
        from seamlog.recorder.live import ShownLive

        source = ShownLive(source, output, live)

    from seamlog.recorder.session_run import run_source

    run = run_source(source, output, values, pace == "realtime", duration, force, storage, snapshot)
    outcome = record_outcome(run, output)
    return _compact(outcome, output) if compact else outcome


def _compacted(output: Path) -> Path:
    return output.with_suffix(f".compact{output.suffix}")


def _compact(outcome: Outcome, output: Path) -> Outcome:
    """After a clean end, the session once more in large chunks; the recording itself stays."""
    from seamlog.mcap.batch import BatchWriter
    from seamlog.session import open_session

    if outcome.ending is not Ending.PASS:
        return replace(outcome, text=f"{outcome.text}\nnot compacted: it did not end clean")
    path = _compacted(output)
    with open_session(output) as session, BatchWriter(path, force=True) as writer:
        writer.compact_session(session)
    document = outcome.document | {"compacted": str(path)}
    return replace(outcome, text=f"{outcome.text}\n{path}: in large chunks", document=document)


def _read_meta(pairs: Sequence[str]) -> dict[str, str]:
    found = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key.strip():
            raise UsageError(f"--meta {pair!r}: write it as key=value")
        found[key.strip()] = value
    return found
