"""`seamlog report`."""

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from seamlog.command import command, force_option, output_option
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from .page import Document


@command()
@click.argument(
    "results", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="RESULTS..."
)
@output_option("The HTML file to write.")
@click.option(
    "--date", type=click.DateTime(["%Y-%m-%d"]), help="Date of the weld; default: its end."
)
@click.option("--title", help="Heading of the report.")
@force_option
def report(
    results: tuple[Path, ...], output: Path, date: datetime | None, title: str | None, force: bool
) -> Outcome:
    """Turn RESULTS directories into one HTML file that opens anywhere, offline."""
    from seamlog.files import check_output
    from seamlog.results import Results

    from .report import Report

    check_output(output, force)
    builder = Report(title, None if date is None else f"{date:%Y-%m-%d}")
    for folder in results:
        builder.add_results(Results.open(folder))
    return _outcome(builder.write(output, force), output)


def _outcome(document: "Document", output: Path) -> Outcome:
    size = output.stat().st_size
    verdict = document.verdict.value
    missing = "" if document.interactive else "; without uPlot: static plots only"
    return Outcome(
        schema="seamlog.report.written",
        text=f"{output}: {verdict}, report {document.id}, {size / 1e6:.2f} MB{missing}",
        document={
            "id": document.id,
            "verdict": verdict,
            "path": str(output),
            "bytes": size,
            "interactive": document.interactive,
        },
        ending=Ending.FINDING if verdict == "FAIL" else Ending.PASS,
    )
