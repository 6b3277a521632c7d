"""`seamlog sweep`: many tunings of controllers, predicted from recorded welds and ranked."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, config_options, force_option, output_option
from seamlog.errors import OutputExists, UsageError
from seamlog.outcome import Outcome

if TYPE_CHECKING:
    from collections.abc import Sequence

    from seamlog.analysis.sweep.ranking import Ranked
    from seamlog.results import Part

_SHOWN = 10


@command("sweep")
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--controller", "controllers", multiple=True, required=True, help="Repeatable.")
@click.option(
    "--grid", multiple=True, metavar="NAME=V,V,...", help="Values of a parameter; repeatable."
)
@click.option(
    "--range", "ranges", multiple=True, metavar="NAME=LOW:HIGH", help="Ends for --sobol points."
)
@click.option("--sobol", type=int, help="Points within the ranges, for each point of the grid.")
@click.option("--figure", type=click.Choice(["rms", "peak"]), help="Figure that ranks.")
@output_option("Results directory; a sweep that stopped goes on there.")
@config_options
@force_option
def sweep(
    sessions: tuple[Path, ...],
    controllers: tuple[str, ...],
    grid: tuple[str, ...],
    ranges: tuple[str, ...],
    sobol: int | None,
    figure: Any,
    output: Path,
    config: Path | None,
    settings: tuple[str, ...],
    force: bool,
) -> Outcome:
    """Predict many tunings from one or several SESSIONs and rank them.

    A parameter is named as in the configuration of the controller (inner ones with dots); with
    several controllers NAME may be controller:parameter. Points that were computed before, from
    the same session and with the same configuration and version, are taken over.
    """
    from seamlog.analysis.sweep.evaluate import evaluate_session
    from seamlog.analysis.sweep.part import sweep_part
    from seamlog.analysis.sweep.plan import make_points
    from seamlog.analysis.sweep.ranking import rank
    from seamlog.analysis.sweep.settings import SweepSettings
    from seamlog.config import load_config
    from seamlog.results import Results

    asked = _asked(sobol, figure)
    chosen = load_config(SweepSettings, "sweep", config, [*settings, *asked])
    grids = chosen.grid | dict(map(_values, grid))
    chosen = chosen.model_copy(
        update={"grid": grids, "ranges": chosen.ranges | dict(map(_ends, ranges))}
    )
    if (output / "sweep.json").exists() and not force:
        raise OutputExists(f"{output} holds a finished sweep; give another name or --force")
    points = make_points(list(dict.fromkeys(controllers)), chosen)
    results = Results.create(output)
    found = [evaluate_session(path, points, chosen, output) for path in dict.fromkeys(sessions)]
    ranked = rank(points, found, chosen.figure)
    part, tables = sweep_part(ranked, found, chosen)
    return _outcome(output, results.write(part, tables), ranked)


def _asked(sobol: int | None, figure: str | None) -> list[str]:
    """The options as settings."""
    asked = {"sobol": sobol, "figure": figure}
    return [f"sweep.{name}={value}" for name, value in asked.items() if value is not None]


def _values(text: str) -> tuple[str, list[Any]]:
    import tomllib

    name, equals, values = text.partition("=")
    if not equals or not name or not values:
        raise UsageError(f"--grid {text!r}: write it as name=value,value,...")
    try:
        return name, list(tomllib.loads(f"v = [{values}]")["v"])
    except tomllib.TOMLDecodeError:
        return name, [_word(word.strip()) for word in values.split(",")]


def _word(word: str) -> Any:
    import tomllib

    try:
        return tomllib.loads(f"v = {word}")["v"]
    except tomllib.TOMLDecodeError:
        return word


def _ends(text: str) -> tuple[str, tuple[float, float]]:
    name, equals, ends = text.partition("=")
    low, colon, high = ends.partition(":")
    try:
        if not (name and equals and colon):
            raise ValueError
        return name, (float(low), float(high))
    except ValueError:
        raise UsageError(f"--range {text!r}: write it as name=low:high") from None


def _outcome(output: Path, part: "Part", ranked: "Sequence[Ranked]") -> Outcome:
    from seamlog.analysis.sweep.part import name_of

    lines = [f"{output}: {part.reason}"]
    for place, row in enumerate(ranked[:_SHOWN], 1):
        mark = "" if row.told_apart or place == 1 else "  (not told from the best)"
        lines.append(f"  {place:>3}  {row.value_mm:.4g} +- {row.u_mm:.2g} mm  {name_of(row)}{mark}")
    if len(ranked) > _SHOWN:
        lines.append(f"  and {len(ranked) - _SHOWN} more in {output / 'sweep.ranking.parquet'}")
    lines += [f"  {finding.severity.value}: {finding.message}" for finding in part.findings]
    document = part.model_dump(mode="json", include={"figures", "findings", "details", "reason"})
    return Outcome("seamlog.sweep", "\n".join(lines), {"results": str(output)} | document)
