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
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from seamlog.analysis.replay.check_original import OriginalCheck
    from seamlog.analysis.replay.run import Replay
    from seamlog.results import Criterion, Part


@command("replay")
@session_argument
@click.option(
    "--controller",
    "controllers",
    multiple=True,
    help="Controller by name, or path.py:Class; repeatable.",
)
@click.option("--estimator", "estimators", multiple=True, help="Estimator by name; repeatable.")
@click.option(
    "--mode",
    type=click.Choice(["both", "shadow", "counterfactual"]),
    default="both",
    show_default=True,
    help="Open loop on the recorded measurements, or in closed loop with the identified axis.",
)
@click.option(
    "--check-original",
    is_flag=True,
    help="The recorded controller must give the recorded commands again (exit code 1 if not).",
)
@output_option("The new session: the original channels and /replay/...", required=False)
@click.option("--results", type=click.Path(path_type=Path), help="Also write the part 'replay'.")
@config_options
@force_option
def replay(
    session: Path,
    controllers: tuple[str, ...],
    estimators: tuple[str, ...],
    mode: Any,
    check_original: bool,
    output: Path | None,
    results: Path | None,
    config: Path | None,
    settings: tuple[str, ...],
    force: bool,
) -> Outcome:
    """Run SESSION through controllers and estimators again.

    A shadow replay says what a controller would have commanded at the recorded moments. A
    counterfactual one puts it in closed loop with the identified axis and predicts the error.
    --check-original runs the recorded controller on the recorded measurements and compares what
    it says with what was recorded, channel by channel, with the tolerances of replay.check.
    """
    from seamlog.analysis.axis_record import load_axis_record
    from seamlog.analysis.live_controller import live_controller
    from seamlog.analysis.replay.check_original import check_session
    from seamlog.analysis.replay.inputs import replay_inputs
    from seamlog.analysis.replay.output import write_replay
    from seamlog.analysis.replay.part import replay_part
    from seamlog.analysis.replay.run import check_names
    from seamlog.analysis.replay.run import replay as run_replay
    from seamlog.analysis.replay.settings import ReplaySettings
    from seamlog.config import load_config
    from seamlog.files import check_output
    from seamlog.results import Results, input_of
    from seamlog.session import open_session

    _require_something(bool(controllers or estimators), check_original, output)
    if output is not None:
        check_output(output, force)
    chosen = load_config(ReplaySettings, "replay", config, settings)
    check_names(controllers, estimators, chosen)
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
        check = check_session(opened, inputs, live, chosen.check) if check_original else None
        if output is not None:
            write_replay(found, opened, output, force)
        files = [input_of(path) for path in opened.paths]
        part, tables = replay_part(found, chosen, opened.welds, files, check)
    if results is not None:
        Results.create(results).write(part, tables)
    return _outcome(output or session, found, part, check)


def _require_something(named: bool, check_original: bool, output: Path | None) -> None:
    if not named and not check_original:
        raise UsageError(
            "name what to replay through: --controller NAME or --estimator NAME, or ask for "
            "--check-original"
        )
    if named and output is None:
        raise UsageError("name the new session that the outputs go to: -o REPLAY.mcap")
    if not named and output is not None:
        raise UsageError("--check-original alone makes no outputs; leave out -o, use --results")


def _outcome(where: Path, found: "Replay", part: "Part", check: "OriginalCheck | None") -> Outcome:
    lines = [f"{where}: {len(found.record)} control periods, {part.reason}"]
    lines += [_judged(criterion) for criterion in part.criteria]
    for figure in part.figures:
        if figure.value is None:
            lines.append(f"  {figure.label}: not known: {figure.reason}")
        else:
            doubt = "" if figure.u is None else f" +- {figure.u:.2g}"
            lines.append(f"  {figure.label}: {figure.value:.4g}{doubt} {figure.unit}".rstrip())
    lines += [f"  {finding.severity.value}: {finding.message}" for finding in part.findings]
    told = {"figures", "findings", "details", "criteria", "verdict"}
    document = {"session": str(where)} | part.model_dump(mode="json", include=told)
    return Outcome("seamlog.replay", "\n".join(lines), document, _ending(check))


def _judged(criterion: "Criterion") -> str:
    if criterion.value is None:
        return f"  {criterion.verdict.value}: {criterion.label}: {criterion.reason}"
    value = f"{criterion.value:.3g} (at most {criterion.upper:.3g}) {criterion.unit}".rstrip()
    return f"  {criterion.verdict.value}: {criterion.label}: {value}"


def _ending(check: "OriginalCheck | None") -> Ending:
    if check is None or check.holds:
        return Ending.PASS
    return Ending.NO_EVIDENCE if check.holds is None else Ending.FINDING
