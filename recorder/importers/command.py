"""`seamlog import`: a foreign log becomes a session, with a loss report."""

from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, force_option, output_option
from seamlog.errors import InputError, UsageError
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from collections.abc import Iterator

    from seamlog.evenness import Evenness

    from .content import Content, Report
    from .conversion import TopicColumns
    from .loss import Loss

BY_SUFFIX = {
    "csv": "csv txt tsv dat asc lvm",
    "mat": "mat",
    "parquet": "parquet pq",
    "tdms": "tdms",
    "ulog": "ulg ulog",
    "ros2": "mcap db3 zstd",
    "ros1": "bag",
    "video": "mp4 mkv avi mov webm mjpeg mjpg mpg m4v",
}
"""Importers of ours and the suffixes they are taken for; a folder is a ROS 2 bag."""


@command("import")
@click.argument("file", type=click.Path(path_type=Path))
@output_option("The session to write; with --guess the map.", required=False)
@click.option(
    "--map",
    "map_file",
    type=click.Path(path_type=Path),
    help="Column map (TOML): which column is which field. Bags and videos need none.",
)
@click.option("--guess", is_flag=True, help="Propose a column map and say what was guessed.")
@click.option("--importer", help="Importer by name; default: by the suffix of FILE.")
@click.option("--dry-run", is_flag=True, help="Report what would be lost; write nothing.")
@force_option
def import_(
    file: Path,
    output: Path | None,
    map_file: Path | None,
    guess: bool,
    importer: str | None,
    dry_run: bool,
    force: bool,
) -> Outcome:
    """Turn the foreign log FILE (or the folder of a ROS 2 bag) into a session.

    Nothing is derived on the way: what FILE does not have stays NaN and is listed as absent. Exit
    code 1 if something that was asked for could not be taken: parts or messages of a bag, frames of
    a video, lines of a table, cells of a column that the map names.
    """
    from seamlog import plugins
    from seamlog.files import check_output

    if output is None and not dry_run and not guess:
        raise UsageError("say where to write with -o SESSION.mcap, or look first with --dry-run")
    if not file.exists():
        raise InputError(f"{file}: no such file")
    if output is not None and not dry_run:
        check_output(output, force)
    reader = plugins.load("seamlog.importers", importer or _importer_for(file))()
    target = None if dry_run else output
    if not hasattr(reader, "write"):
        return _import_table(reader, file, target, map_file, guess, force)
    if guess or map_file:
        with _as_session(reader, file) as (content, copied, report):
            if guess:
                return _guess(content, file, target)
            content.notes += report.notes
            return _import_mapped(content, file, target, map_file, force, copied, report.losses)
    return _import_whole(reader, file, target, force)


def _importer_for(file: Path) -> str:
    suffix = file.suffix.lstrip(".").lower()
    if file.is_dir():
        return "ros2"
    return next((name for name, known in BY_SUFFIX.items() if suffix in known.split()), suffix)


def _import_table(
    reader: Any, file: Path, output: Path | None, map_file: Path | None, guess: bool, force: bool
) -> Outcome:
    from .content import content_of

    if file.is_dir():
        raise InputError(f"{file} is a folder; name a file in it")
    content = content_of(reader.load(file))
    if guess:
        return _guess(content, file, output)
    if map_file is None:
        raise UsageError(
            f"say which column of {file.name} is which field with --map; "
            f"'seamlog import {file} --guess -o map.toml' proposes one"
        )
    return _import_mapped(content, file, output, map_file, force)


def _guess(content: "Content", file: Path, output: Path | None) -> Outcome:
    from seamlog.files import write_bytes

    from .guess import guess

    text = guess(content, file)
    if output is not None:
        write_bytes(output, text.encode())
    told = [*content.losses, *content.lost_cells.values(), *content.notes]
    notes = [f"# {note}" for note in told]
    head = [f"# written to {output}"] if output else []
    document = {"file": str(file), "map": text, "notes": told}
    return Outcome("seamlog.import.guess", "\n".join([text, *notes, *head]), document)


def _import_mapped(
    content: "Content",
    file: Path,
    output: Path | None,
    map_file: Path | None,
    force: bool,
    copied: Path | None = None,
    losses: Sequence[str] = (),
) -> Outcome:
    from seamlog.mcap.batch import BatchWriter
    from seamlog.mcap.file import McapFile

    from .column_map import load_column_map
    from .conversion import convert

    assert map_file is not None
    mapping = load_column_map(map_file, content.columns, content.units)
    topics, loss = convert(content, mapping, file)
    loss.losses = [*losses, *loss.losses]
    if output is not None:
        facts = _provenance(file) | _provenance(map_file, "map")
        facts |= {"source": mapping.source} if mapping.source else {}
        with BatchWriter(output, force) as writer:
            writer.add_metadata("seamlog.import", facts)
            if copied is not None:
                whole = McapFile(copied)
                writer.copy_file(whole)
                whole.close()
            for topic, part in topics.items():
                writer.write_as(topic, part.channel, part.columns, metadata=part.metadata)
    return _outcome(file, output, topics, loss)


def _import_whole(reader: Any, file: Path, output: Path | None, force: bool) -> Outcome:
    """All messages of a bag, all frames of a video; a dry run writes into a scratch file."""
    import tempfile

    from seamlog.mcap.batch import BatchWriter
    from seamlog.progress import spinner

    with tempfile.TemporaryDirectory() as folder:
        path = output or Path(folder) / "dry.mcap"
        with spinner(f"importing {file}"), BatchWriter(path, force) as writer:
            report = reader.write(file, writer)
            writer.add_metadata("seamlog.import", _provenance(file))
        return _whole_outcome(file, path, output, report)


@contextmanager
def _as_session(reader: Any, file: Path) -> "Iterator[tuple[Content, Path, Report]]":
    import tempfile

    from seamlog.mcap.batch import BatchWriter
    from seamlog.session import open_session

    from .session_columns import content_of_session

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "whole.mcap"
        with BatchWriter(path) as writer:
            report = reader.write(file, writer)
        with open_session(path) as session:
            yield content_of_session(session), path, report


def _provenance(file: Path, role: str = "file") -> dict[str, str]:
    from seamlog.results import input_of

    facts = {role: file.name}
    return facts | ({f"{role}_sha256": input_of(file).sha256} if file.is_file() else {})


def _whole_outcome(file: Path, path: Path, output: Path | None, report: "Report") -> Outcome:
    from seamlog.session import open_session

    from .session_columns import unreadable

    with open_session(path) as session:
        info = session.info
        rows = {channel.topic: channel.count for channel in info.channels.values()}
        report.losses += unreadable(session)
    head = f"{file} -> {output}" if output else f"{file}: dry run, nothing written"
    when = f", {info.duration_s:.3f} s from {_date(info.start_ns)}" if info.message_count else ""
    lines = [head, f"{info.message_count} messages{when}"]
    lines += [f"  {topic}: {count}" for topic, count in rows.items()]
    lines += [*report.lines, *([] if report.losses else ["nothing was lost"])]
    document = {
        "file": str(file),
        "session": str(output) if output else None,
        "messages": info.message_count,
        "start_ns": info.start_ns,
        "duration_s": info.duration_s,
        "topics": list(rows),
        "losses": report.losses,
        "notes": report.notes,
    }
    ending = Ending.FINDING if report.losses else Ending.PASS
    return Outcome("seamlog.import", "\n".join(lines), document, ending)


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
    lines += [f"{topic}: {_timing_text(timing)}" for topic, timing in loss.timing.items()]
    if loss.not_imported:
        lines.append(f"not imported: {', '.join(loss.not_imported)}")
    lines += [f"absent in {topic}: {', '.join(names)}" for topic, names in loss.absent.items()]
    lines += [f"{name}: {count} values missing" for name, count in loss.missing_values.items()]
    lines += [*(f"lost: {text}" for text in loss.losses), *loss.notes]
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
        "timing": {topic: asdict(timing) for topic, timing in loss.timing.items()},
        "losses": loss.losses,
        "notes": loss.notes,
    }
    ending = Ending.FINDING if loss.losses else Ending.PASS
    return Outcome("seamlog.import", "\n".join(lines), document, ending)


def _timing_text(timing: "Evenness") -> str:
    text = f"period {timing.period_s * 1e3:.4g} ms, jitter {timing.jitter_s * 1e3:.3g} ms"
    if timing.gaps:
        text += f", {timing.gaps} gap{'s' if timing.gaps > 1 else ''}"
        text += f", the longest {timing.longest_gap_s:.4g} s"
    return text + (f", {timing.repeated} times repeated" if timing.repeated else "")


def _date(time_ns: int) -> str:
    from datetime import UTC, datetime

    return f"{datetime.fromtimestamp(time_ns // 1_000_000_000, UTC):%Y-%m-%d %H:%M:%S} UTC"


def _duration_s(topics: Mapping[str, "TopicColumns"]) -> float:
    stamp_ns = next(iter(topics.values())).columns["stamp_ns"]
    return float(stamp_ns[-1] - stamp_ns[0]) * 1e-9
