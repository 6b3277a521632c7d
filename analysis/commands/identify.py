"""`seamlog identify`: inertia and friction of the axis."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, force_option, output_option, session_argument
from seamlog.outcome import Outcome

if TYPE_CHECKING:
    from seamlog.analysis.axis_record import AxisRecord
    from seamlog.results import Figure, Part


@command("identify")
@session_argument
@click.option(
    "--method",
    type=click.Choice(
        ["auto", "gated", "batch", "idim-ls", "idim-iv", "output-error", "open-loop"]
    ),
    default="auto",
    show_default=True,
    help="auto: by sampling rate; gated for slow loops, idim-ls for fast records.",
)
@click.option(
    "--friction",
    type=click.Choice(
        ["auto", "symmetric", "asymmetric", "symmetric-stribeck", "asymmetric-stribeck"]
    ),
    default="symmetric",
    show_default=True,
    help="Friction model; auto: model and lag by cross-validation on the record.",
)
@click.option(
    "--compare",
    "reference",
    type=click.Path(path_type=Path),
    help="Published values (TOML) to set beside the identified ones.",
)
@click.option(
    "--validate",
    "other",
    type=click.Path(path_type=Path),
    help="Another session of the same axis that the identified model has to predict.",
)
@click.option("--weld", type=int, help="Use only the motion of this weld.")
@output_option("Results directory to write the part 'identification' to.", required=False)
@force_option
def identify(
    session: Path,
    method: Any,
    friction: Any,
    reference: Path | None,
    other: Path | None,
    weld: int | None,
    output: Path | None,
    force: bool,
) -> Outcome:
    """Find inertia, viscous and Coulomb friction and offset of the axis in SESSION.

    Refuses (exit code 6) what the motion cannot tell.
    """
    from seamlog.analysis.identification.assess import IdentifyOptions, identify_session
    from seamlog.analysis.identification.compare import load_reference
    from seamlog.analysis.welds import chosen_welds
    from seamlog.files import check_output
    from seamlog.results import Results
    from seamlog.session import open_session

    if output is not None:
        check_output(output / "identification.json", force) if output.is_dir() else None
    published = load_reference(reference) if reference else None
    options = IdentifyOptions(method, friction, _record_of(other), published, reference)
    with open_session(session) as opened:
        place = chosen_welds(opened, weld)[0] if weld is not None else None
        part, tables = identify_session(opened, place, options)
    if output is not None:
        Results.create(output).write(part, tables)
    source = published.source if published else ""
    return Outcome("seamlog.identify", text_of(part, source), document_of(part))


def _record_of(path: Path | None) -> "AxisRecord | None":
    from seamlog.analysis.axis_record import load_axis_record
    from seamlog.session import open_session

    if path is None:
        return None
    with open_session(path) as opened:
        return load_axis_record(opened)


def document_of(part: "Part") -> dict[str, Any]:
    """The figures, findings and details, JSON-ready."""
    return part.model_dump(mode="json", include={"figures", "findings", "details", "reason"})


def text_of(part: "Part", source: str) -> str:
    """A short table for people."""
    lines = [part.reason]
    lines += [_line(figure) for figure in part.figures]
    rows = part.details["comparison"]
    if rows:
        lines += ["", f"against {source}:"]
        lines.append(f"  {'':<28} {'identified':>12} {'published':>12}  difference")
    lines += [_comparison(row) for row in rows]
    lines += [f"  {finding.severity.value}: {finding.message}" for finding in part.findings]
    return "\n".join(lines)


def _line(figure: "Figure") -> str:
    if figure.value is None:
        return f"  {figure.label:<28} not known: {figure.reason}"
    doubt = f" +- {figure.u:.4f}" if figure.u is not None else ""
    return f"  {figure.label:<28} {figure.value:12.4f}{doubt} {figure.unit}"


def _comparison(row: dict[str, Any]) -> str:
    deviation = row["difference_sd"]
    difference = f"{row['identified'] - row['published']:+.4f}"
    told = f" ({deviation:+.2f} sd)" if deviation is not None else ""
    label = row["name"].replace("_", " ")
    return f"  {label:<28} {row['identified']:12.4f} {row['published']:12.4f}  {difference}{told}"
