"""`seamlog report`."""

import json
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from seamlog.command import command, force_option, output_option
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from .document import Document
    from .export import TableFormat

results_argument = click.argument(
    "results", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="RESULTS..."
)
date_option = click.option(
    "--date", type=click.DateTime(["%Y-%m-%d"]), help="Date of the weld; default: its end."
)


@command()
@results_argument
@output_option("The HTML file to write; what else is asked for stands beside it.")
@date_option
@click.option("--title", help="Heading of the report.")
@click.option("--pdf", is_flag=True, help="Print it as PDF too, through Chromium.")
@click.option("--twin", is_flag=True, help="Write its content as JSON too.")
@click.option(
    "--tables",
    type=click.Choice(["csv", "parquet"]),
    help="Write its figures and tables into a folder too.",
)
@click.option(
    "--max-mb",
    type=click.FloatRange(min=1),
    default=25.0,
    show_default=True,
    help="Largest size of the file; beyond it pictures are thinned first.",
)
@force_option
def report(
    results: tuple[Path, ...],
    output: Path,
    date: datetime | None,
    title: str | None,
    pdf: bool,
    twin: bool,
    tables: "TableFormat | None",
    max_mb: float,
    force: bool,
) -> Outcome:
    """Turn RESULTS directories into one HTML file that opens anywhere, offline."""
    from seamlog.files import check_output, write_bytes
    from seamlog.results import Results

    from .export import export_tables
    from .pdf import print_pdf
    from .report import Report

    beside = {
        "pdf": output.with_suffix(".pdf") if pdf else None,
        "twin": output.with_suffix(".json") if twin else None,
        "tables": output.with_suffix(".tables") if tables else None,
    }
    for path in (output, *beside.values()):
        if path is not None:
            check_output(path, force)
    builder = Report(title, day_of(date), largest_bytes=round(1e6 * max_mb))
    for folder in results:
        builder.add_results(Results.open(folder))
    document = builder.write(output, force)
    if beside["twin"]:
        write_bytes(beside["twin"], json.dumps(document.twin(), indent=1).encode() + b"\n", force)
    if beside["tables"] and tables:
        export_tables(builder.runs, beside["tables"], tables)
    if beside["pdf"]:
        print_pdf(output, beside["pdf"], force)
    return _outcome(document, output, {kind: path for kind, path in beside.items() if path})


def day_of(date: datetime | None) -> str | None:
    """A day as the report prints it."""
    return None if date is None else f"{date:%Y-%m-%d}"


def _outcome(document: "Document", output: Path, beside: dict[str, Path]) -> Outcome:
    size = output.stat().st_size
    verdict = document.verdict.value
    missing = "" if document.interactive else "; without uPlot: static plots only"
    lines = [f"{output}: {verdict}, report {document.id}, {size / 1e6:.2f} MB{missing}"]
    lines += [f"  {note}" for note in document.notes]
    lines += [str(path) for path in beside.values()]
    return Outcome(
        schema="seamlog.report.written",
        text="\n".join(lines),
        document={
            "id": document.id,
            "verdict": verdict,
            "path": str(output),
            "bytes": size,
            "interactive": document.interactive,
            "notes": document.notes,
            **{kind: str(path) for kind, path in beside.items()},
        },
        ending=Ending.FINDING if verdict == "FAIL" else Ending.PASS,
    )
