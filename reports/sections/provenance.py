"""Where every number comes from: inputs with their hashes, versions, configuration."""

import json
from collections.abc import Sequence

from seamlog.reports.content import AnyBlock, Fact, FactTable
from seamlog.reports.run import Run


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Inputs, the versions that made the parts, and the configuration of each."""
    blocks: list[AnyBlock] = []
    for run in runs:
        blocks.append(FactTable(caption=f"Inputs of {run.label}", facts=_inputs(run)))
        blocks.append(FactTable(caption=f"Parts of {run.label}", facts=_versions(run)))
        blocks.append(FactTable(caption=f"Configuration of {run.label}", facts=_settings(run)))
    return blocks


def _inputs(run: Run) -> list[Fact]:
    inputs = {(entry.name, entry.sha256): entry for part in run.parts for entry in part.inputs}
    facts = [
        Fact(label=entry.name, value=f"SHA-256 {entry.sha256}, {entry.bytes:,} bytes")
        for entry in inputs.values()
    ]
    return facts or [Fact(label="Inputs")]


def _versions(run: Run) -> list[Fact]:
    return [
        Fact(
            label=part.stem,
            value=f"seamlog {part.seamlog_version}" if part.seamlog_version else None,
        )
        for part in run.parts
    ]


def _settings(run: Run) -> list[Fact]:
    return [
        Fact(
            label=part.stem,
            value=json.dumps(part.configuration, sort_keys=True) if part.configuration else None,
        )
        for part in run.parts
    ]
