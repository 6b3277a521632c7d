"""`seamlog compare`."""

from datetime import datetime
from pathlib import Path
from typing import Any

import click

from seamlog.command import command, force_option, output_option
from seamlog.outcome import Ending, Outcome

from .commands import date_option, day_of, results_argument


@command()
@results_argument
@output_option("Write the comparison as an HTML report.", required=False)
@click.option(
    "--tolerance",
    "tolerances",
    multiple=True,
    metavar="[NAME=]VALUE[%]",
    help="How much worse a figure may get: 10% for all, rms_error_mm=0.05 for one. Default: 5%.",
)
@click.option("--md", is_flag=True, help="Print Markdown, for a pull request.")
@date_option
@click.option("--title", help="Heading of the report.")
@force_option
def compare(
    results: tuple[Path, ...],
    output: Path | None,
    tolerances: tuple[str, ...],
    md: bool,
    date: datetime | None,
    title: str | None,
    force: bool,
) -> Outcome:
    """Set RESULTS directories beside the first of them; exit code 1 if one is worse.

    Of one directory alone its replays are set beside the recorded run.
    """
    from tempfile import TemporaryDirectory

    from seamlog.files import check_output
    from seamlog.results import Results, Verdict

    from .compare_report import compare_report, markdown, summary
    from .comparison import compare_runs
    from .replayed import replays_of
    from .run import Run
    from .tolerances import read_tolerances

    if output is not None:
        check_output(output, force)
    asked = read_tolerances(tolerances)
    opened = [Results.open(folder) for folder in results]
    with TemporaryDirectory() as folder:
        if len(opened) == 1:
            opened = replays_of(opened[0], Path(folder))
        runs = [Run(each, number) for number, each in enumerate(opened)]
        comparison = compare_runs(runs, asked)
        if output is not None:
            compare_report(runs, comparison, title, day_of(date)).write(output, force)
    lines = [f"{comparison.verdict.value}: {summary(comparison)}"]
    lines += [f"  {text}" for text in (*comparison.regressions, *comparison.unknown)]
    document: dict[str, Any] = {
        "verdict": comparison.verdict.value,
        "labels": comparison.labels,
        "regressions": comparison.regressions,
        "unknown": comparison.unknown,
        "figures": [change.model_dump(mode="json") for change in comparison.changes],
        "limits": [limit.model_dump(mode="json") for limit in comparison.limits],
        "paired": [item.model_dump(mode="json") for item in comparison.paired],
    }
    endings = {Verdict.FAIL: Ending.FINDING, Verdict.PASS: Ending.PASS}
    return Outcome(
        schema="seamlog.compare",
        text=markdown(comparison) if md else "\n".join([*lines, *_written(output)]),
        document=document | ({"path": str(output)} if output else {}),
        ending=endings.get(comparison.verdict, Ending.NO_EVIDENCE),
    )


def _written(output: Path | None) -> list[str]:
    return [str(output)] if output else []
