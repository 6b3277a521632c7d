"""`seamlog replay`: what other controllers and estimators make of a recorded weld."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import (
    command,
    config_options,
    force_option,
    output_option,
    session_argument,
)
from seamlog.errors import UsageError
from seamlog.outcome import Outcome

if TYPE_CHECKING:
    from seamlog.analysis.replay.run import Replay
    from seamlog.results import Part


@command("replay")
@session_argument
@click.option("--controller", "controllers", multiple=True, help="Controller by name; repeatable.")
@click.option("--estimator", "estimators", multiple=True, help="Estimator by name; repeatable.")
@click.option(
    "--mode",
    type=click.Choice(["both", "shadow", "counterfactual"]),
    default="both",
    show_default=True,
    help="Open loop on the recorded measurements, or in closed loop with the identified axis.",
)
@output_option("The new session: the original channels and /replay/...")
@click.option("--results", type=click.Path(path_type=Path), help="Also write the part 'replay'.")
@config_options
@force_option
def replay(
    session: Path,
    controllers: tuple[str, ...],
    estimators: tuple[str, ...],
    mode: Any,
    output: Path,
    results: Path | None,
    config: Path | None,
    settings: tuple[str, ...],
    force: bool,
) -> Outcome:
    """Run SESSION through controllers and estimators again.

    A shadow replay says what a controller would have commanded at the recorded moments. A
    counterfactual one puts it in closed loop with the identified axis and predicts the error.
    """
    from seamlog.analysis.axis_record import load_axis_record
    from seamlog.analysis.live_controller import live_controller
    from seamlog.analysis.replay.inputs import replay_inputs
    from seamlog.analysis.replay.output import write_replay
    from seamlog.analysis.replay.part import replay_part
    from seamlog.analysis.replay.run import replay as run_replay
    from seamlog.analysis.replay.settings import ReplaySettings
    from seamlog.config import load_config
    from seamlog.files import check_output
    from seamlog.results import Results, input_of
    from seamlog.session import open_session

    if not controllers and not estimators:
        raise UsageError("name what to replay through: --controller NAME or --estimator NAME")
    check_output(output, force)
    chosen = load_config(ReplaySettings, "replay", config, settings)
    with open_session(session) as opened:
        inputs = replay_inputs(load_axis_record(opened))
        live = live_controller(opened.metadata, str(opened.path))
        found = run_replay(
            inputs,
            live,
            list(dict.fromkeys(controllers)),
            list(dict.fromkeys(estimators)),
            mode,
            chosen,
        )
        write_replay(found, opened, output, force)
        files = [input_of(path) for path in opened.paths]
        part, tables = replay_part(found, chosen, opened.welds, files)
    if results is not None:
        Results.create(results).write(part, tables)
    return _outcome(output, found, part)


def _outcome(output: Path, found: "Replay", part: "Part") -> Outcome:
    lines = [f"{output}: {len(found.record)} control periods, {part.reason}"]
    for figure in part.figures:
        if figure.value is None:
            lines.append(f"  {figure.label}: not known: {figure.reason}")
        else:
            doubt = "" if figure.u is None else f" +- {figure.u:.2g}"
            lines.append(f"  {figure.label}: {figure.value:.4g}{doubt} {figure.unit}".rstrip())
    lines += [f"  {finding.severity.value}: {finding.message}" for finding in part.findings]
    document = part.model_dump(mode="json", include={"figures", "findings", "details"})
    return Outcome("seamlog.replay", "\n".join(lines), {"session": str(output)} | document)
