"""`seamlog export`: topics of a session, or of a part of it, in the formats of others."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, force_option, output_option, session_argument
from seamlog.errors import UsageError
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from seamlog.session import Session

BY_SUFFIX = {
    ".parquet": "parquet",
    ".csv": "csv",
    ".mat": "mat",
    ".mp4": "video",
    ".mkv": "video",
    ".mov": "video",
    ".rrd": "rerun",
}
FORMATS = tuple(dict.fromkeys(BY_SUFFIX.values()))


@command()
@session_argument
@output_option("A file, or for Parquet and CSV a folder with one file per topic.")
@click.option("--format", "kind", type=click.Choice(FORMATS), help="Default: by the suffix.")
@click.option("--topic", "topics", multiple=True, metavar="TOPIC", help="Only these.")
@click.option("--from", "start", metavar="T", help="Seconds from the start, or a date and time.")
@click.option("--to", "end", metavar="T", help="Up to here, exclusive.")
@click.option("--weld", type=int, metavar="N", help="Only weld N, counted from 1.")
@force_option
def export(
    session: Path,
    output: Path,
    kind: str | None,
    topics: tuple[str, ...],
    start: str | None,
    end: str | None,
    weld: int | None,
    force: bool,
) -> Outcome:
    """Write topics of SESSION as Parquet, CSV, MATLAB, video or Rerun file.

    Times are log times, as in `seamlog info`. CSV and MATLAB files hold pictures only where their
    topic is named; export them as video. Exit code 1 if something of the session is damaged.
    """
    from seamlog.session import open_session

    kind = kind or BY_SUFFIX.get(output.suffix.lower())
    if kind is None:
        known = ", ".join(BY_SUFFIX)
        raise UsageError(f"{output}: say --format, or use one of the suffixes {known}")
    with open_session(session) as opened:
        part = opened.weld(weld) if weld is not None else opened
        part = _window(part, opened, start, end)
        written = _write(part, output, kind, topics, force)
        problems = opened.problems
    lines = [f"{path}: {count} {what}" for path, count, what in written]
    document = {
        "session": str(session),
        "format": kind,
        "files": [{"path": str(path), "count": count} for path, count, _ in written],
        "problems": problems,
    }
    ending = Ending.FINDING if problems else Ending.PASS
    return Outcome("seamlog.export", "\n".join([*lines, *problems]), document, ending)


def _window(part: "Session", whole: "Session", start: str | None, end: str | None) -> "Session":
    if start is None and end is None:
        return part
    info = whole.info
    first = _moment(start, info.start_ns, "--from") if start else 0
    last = _moment(end, info.start_ns, "--to") if end else info.end_ns + 1
    if last <= first:
        raise UsageError("--from is not before --to")
    return part.window(first, last)


def _moment(text: str, start_ns: int, option: str) -> int:
    """Ns since 1970 of seconds from the start, or of a date and time (UTC unless it says)."""
    from datetime import UTC, datetime

    try:
        return start_ns + round(float(text) * 1_000_000_000)
    except (ValueError, OverflowError):
        pass
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise UsageError(
            f"{option} {text!r} is neither seconds from the start nor a date and time"
        ) from error
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    since = moment - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000


def _write(
    part: "Session", output: Path, kind: str, topics: tuple[str, ...], force: bool
) -> list[tuple[Path, int, str]]:
    from seamlog.export.parts import exported_topics
    from seamlog.files import check_output
    from seamlog.progress import track

    if kind == "video":
        from seamlog.export.video import write_video
        from seamlog.session import IMAGE_TOPIC

        if len(topics) > 1:
            raise UsageError("a video shows one topic; export the others on their own")
        topic = topics[0] if topics else IMAGE_TOPIC
        return [(output, write_video(part, topic, output, force), "frames")]
    wanted = exported_topics(part, topics, pictures=kind in ("parquet", "rerun"))
    if not wanted:
        raise UsageError(f"{part.path} has no messages in this range that {kind} could hold")
    if kind in ("mat", "rerun"):
        check_output(output, force)
        return [(output, _whole_writer(kind)(part, wanted, output, force), "values")]
    pairs = _table_paths(output, kind, wanted, force)
    write = _table_writer(kind)
    return [
        (path, write(part, topic, path, force), "rows")
        for topic, path in track(pairs, "exporting", len(pairs))
    ]


def _table_paths(output: Path, kind: str, topics: list[str], force: bool) -> list[tuple[str, Path]]:
    from seamlog.errors import OutputExists
    from seamlog.export.parts import file_name

    if output.suffix.lower() == f".{kind}":
        if len(topics) > 1:
            raise UsageError(
                f"{len(topics)} topics do not fit one table: pick one with --topic, or give a "
                f"folder ({output.stem}/ with --format {kind})"
            )
        return [(topics[0], output)]
    if output.exists() and not output.is_dir():
        raise OutputExists(f"{output} is a file; a folder is needed for {len(topics)} topics")
    output.mkdir(exist_ok=True)
    paths = [(topic, output / f"{file_name(topic)}.{kind}") for topic in topics]
    if not force and any(path.exists() for _, path in paths):
        raise OutputExists(f"{output} holds tables already; give another name or --force")
    return paths


def _table_writer(kind: str) -> Any:
    from seamlog.export.tables import write_csv, write_parquet

    return write_parquet if kind == "parquet" else write_csv


def _whole_writer(kind: str) -> Any:
    if kind == "mat":
        from seamlog.export.mat import write_mat

        return write_mat
    from seamlog.export.rerun import write_rerun

    return write_rerun
