"""`seamlog analyze`: a session and its photos to a results directory."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from seamlog.command import (
    command,
    config_options,
    force_option,
    output_option,
    session_argument,
)
from seamlog.errors import OutputExists
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from seamlog.results import Figure, Part

_OF_BEADS = {"surface", "quality", "join"}
"""Parts that go with photos: those of older photos or limits must not stay beside new ones."""
_TOLD = {
    "health": ("messages", "dropped", "lost", "gaps"),
    "tracking": ("rms_error_mm", "peak_error_mm", "mean_weld_speed_mm_s"),
    "identification": ("inertia", "viscous_friction", "coulomb_friction", "offset"),
}
"""Figures of a part that the terminal shows; the results hold all."""


@command("analyze")
@session_argument
@click.argument("photos", nargs=-1, type=click.Path(path_type=Path))
@output_option("Results directory.")
@click.option("--weld", type=int, help="Only this weld; default: each.")
@click.option(
    "--start",
    type=click.Choice(["left", "right", "top", "bottom"]),
    help="Side of the photo at which the bead starts.",
)
@config_options
@force_option
def analyze(
    session: Path,
    photos: tuple[Path, ...],
    output: Path,
    weld: int | None,
    start: str | None,
    config: Path | None,
    settings: tuple[str, ...],
    force: bool,
) -> Outcome:
    """Turn SESSION and PHOTOs of its bead into results: health, tracking, identification, join.

    Without PHOTO the photos attached to the session are taken.
    """
    from seamlog.analysis.assess import AnalyzeOptions, assess_session
    from seamlog.results import Results
    from seamlog.session import open_session

    if output.is_dir() and any(output.glob("*.json")) and not force:
        raise OutputExists(f"{output} holds results already; give another name or --force")
    options = AnalyzeOptions(photos, weld, start, config, settings)
    with open_session(session) as opened:
        found = assess_session(opened, options)
    results = Results.create(output)
    kinds = {part.part for part, _, _ in found}
    _remove_old(output, kinds | (_OF_BEADS if "bead" in kinds else set()))
    parts = [results.write(part, tables, pictures) for part, tables, pictures in found]
    return _outcome(output, parts)


def _remove_old(folder: Path, kinds: set[str]) -> None:
    """Parts of the kinds that are written anew, so that no weld of an older run stays."""
    for path in folder.glob("*.json"):
        if path.name.split(".")[0] in kinds:
            path.unlink()


def _outcome(output: Path, parts: list["Part"]) -> Outcome:
    lines = [str(output)]
    for part in parts:
        lines.append(f"{part.title}: {part.verdict.value}{_because(part)}")
        told = [part.figure(name) for name in _TOLD.get(part.part, ())] or part.figures[:4]
        lines += [f"  {_line(figure)}" for figure in told if figure is not None]
        lines += [f"  {f.severity.value}: {f.message}" for f in part.findings]
    faults = [f for part in parts for f in part.findings if f.severity.value == "fault"]
    failed = any(part.verdict.value == "FAIL" for part in parts)
    document = {
        "results": str(output),
        "parts": [
            part.model_dump(mode="json", include={"part", "index", "verdict", "reason", "figures"})
            for part in parts
        ],
    }
    ending = Ending.FINDING if failed or faults else Ending.PASS
    return Outcome("seamlog.analyze", "\n".join(lines), document, ending)


def _because(part: "Part") -> str:
    return f" ({part.reason})" if part.reason else ""


def _line(figure: "Figure") -> str:
    if figure.value is None:
        return f"{figure.label}: not known: {figure.reason}"
    value = f"{figure.value:.5g}" if isinstance(figure.value, float) else str(figure.value)
    doubt = "" if figure.u is None else f" +- {figure.u:.2g}"
    return f"{figure.label}: {value}{doubt} {figure.unit}".rstrip()
