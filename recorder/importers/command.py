"""`seamlog import`: a foreign log becomes a session, with a loss report."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, force_option, output_option
from seamlog.errors import InputError, UsageError
from seamlog.outcome import Outcome

if TYPE_CHECKING:
    from .column_map import ColumnMap
    from .conversion import Loss, TopicColumns


@command("import")
@click.argument("file", type=click.Path(path_type=Path))
@output_option("The session to write.", required=False)
@click.option(
    "--map",
    "map_file",
    type=click.Path(path_type=Path),
    required=True,
    help="Column map (TOML): which column is which field.",
)
@click.option("--importer", help="Importer by name; default: by the suffix of FILE.")
@click.option("--dry-run", is_flag=True, help="Report what would be lost; write nothing.")
@force_option
def import_(
    file: Path,
    output: Path | None,
    map_file: Path,
    importer: str | None,
    dry_run: bool,
    force: bool,
) -> Outcome:
    """Turn the foreign log FILE into a session.

    Nothing is derived on the way: what FILE does not have stays NaN and is listed as absent.
    """
    from seamlog import plugins
    from seamlog.files import check_output

    from .column_map import load_column_map
    from .conversion import convert

    if output is None and not dry_run:
        raise UsageError("say where to write with -o SESSION.mcap, or look first with --dry-run")
    if not file.is_file():
        raise InputError(f"{file}: no such file")
    if output is not None:
        check_output(output, force)
    reader = plugins.load("seamlog.importers", importer or file.suffix.lstrip(".").lower())()
    columns = reader.load(file)
    mapping = load_column_map(map_file, columns)
    topics, loss = convert(columns, mapping, file)
    if output is not None and not dry_run:
        _write(output, force, topics, _provenance(file, map_file, mapping))
    return _outcome(file, None if dry_run else output, topics, loss)


def _write(
    output: Path, force: bool, topics: Mapping[str, "TopicColumns"], provenance: dict[str, str]
) -> None:
    from seamlog.mcap.batch import BatchWriter

    with BatchWriter(output, force) as writer:
        writer.add_metadata("seamlog.import", provenance)
        for topic, content in topics.items():
            writer.write(topic, content.columns, metadata=content.metadata)


def _provenance(file: Path, map_file: Path, mapping: "ColumnMap") -> dict[str, str]:
    from seamlog.results import input_of

    facts = {
        "file": file.name,
        "file_sha256": input_of(file).sha256,
        "map": map_file.name,
        "map_sha256": input_of(map_file).sha256,
    }
    return facts | ({"source": mapping.source} if mapping.source else {})


def _outcome(
    file: Path, output: Path | None, topics: Mapping[str, "TopicColumns"], loss: "Loss"
) -> Outcome:
    seconds = _duration_s(topics)
    head = f"{file} -> {output}" if output else f"{file}: dry run, nothing written"
    first_ns = int(next(iter(topics.values())).columns["stamp_ns"][0])
    lines = [
        head,
        f"{loss.rows} rows, {seconds:.3f} s from {_date(first_ns)}, topics {', '.join(topics)}",
    ]
    if loss.not_imported:
        lines.append(f"not imported: {', '.join(loss.not_imported)}")
    lines += [f"absent in {topic}: {', '.join(names)}" for topic, names in loss.absent.items()]
    lines += [f"{name}: {count} values missing" for name, count in loss.missing_values.items()]
    document: dict[str, Any] = {
        "file": str(file),
        "session": str(output) if output else None,
        "rows": loss.rows,
        "duration_s": seconds,
        "start_ns": first_ns,
        "topics": list(topics),
        "not_imported": loss.not_imported,
        "absent": loss.absent,
        "missing_values": loss.missing_values,
    }
    return Outcome("seamlog.import", "\n".join(lines), document)


def _date(time_ns: int) -> str:
    from datetime import UTC, datetime

    return f"{datetime.fromtimestamp(time_ns // 1_000_000_000, UTC):%Y-%m-%d %H:%M:%S} UTC"


def _duration_s(topics: Mapping[str, "TopicColumns"]) -> float:
    stamp_ns = next(iter(topics.values())).columns["stamp_ns"]
    return float(stamp_ns[-1] - stamp_ns[0]) * 1e-9
