"""Where every number comes from: inputs with their hashes, versions, configuration."""

import json
from collections.abc import Sequence

from seamlog.reports.content import AnyBlock, Fact, FactTable
from seamlog.reports.run import Run
from seamlog.results import Part


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Inputs, and for each part the version that made it and its settings."""
    blocks: list[AnyBlock] = []
    for run in runs:
        blocks.append(FactTable(caption=f"Inputs of {run.label}", facts=_inputs(run)))
        blocks.append(FactTable(caption=f"Parts of {run.label}", facts=_parts(run)))
    return blocks


def _inputs(run: Run) -> list[Fact]:
    inputs = {(entry.name, entry.sha256): entry for part in run.parts for entry in part.inputs}
    facts = [
        Fact(label=entry.name, value=f"SHA-256 {entry.sha256}, {entry.bytes:,} bytes")
        for entry in inputs.values()
    ]
    return facts or [Fact(label="Inputs")]


def _parts(run: Run) -> list[Fact]:
    return [Fact(label=part.stem, value=_made(part)) for part in run.parts]


def _made(part: Part) -> str:
    version = f"seamlog {part.seamlog_version}" if part.seamlog_version else "version not recorded"
    if not part.configuration:
        return f"{version}, no settings stated"
    return f"{version}, settings {json.dumps(part.configuration, sort_keys=True)}"
