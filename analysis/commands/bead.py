"""`seamlog bead`: measure beads on photos."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, config_options, force_option, group, output_option
from seamlog.errors import EvidenceError, OutputExists, UsageError
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from seamlog.analysis.bead.assess import AssessedPhoto


@group("bead")
def bead() -> None:
    """Measure the bead on photos taken after the weld."""


@command("measure")
@click.argument("photos", nargs=-1, type=click.Path(path_type=Path), metavar="[PHOTO]...")
@click.option(
    "--session",
    type=click.Path(path_type=Path),
    help="Session of the weld; its attached photos are taken when no PHOTO is given.",
)
@click.option("--weld", type=int, help="The weld of the session that the photos show.")
@click.option(
    "--calibration",
    type=click.Path(path_type=Path),
    help="Calibration of the camera; default: <photo>.calibration.json beside the photo.",
)
@click.option(
    "--start",
    type=click.Choice(["left", "right", "top", "bottom"]),
    help="Side of the photo at which the weld began.",
)
@output_option("Results directory.", required=False)
@config_options
@force_option
def measure(
    photos: tuple[Path, ...],
    session: Path | None,
    weld: int | None,
    calibration: Path | None,
    start: str | None,
    output: Path | None,
    config: Path | None,
    settings: tuple[str, ...],
    force: bool,
) -> Outcome:
    """Measure width and evenness of the bead on PHOTOs, in mm with a calibration, else in px.

    Refuses (exit code 6) a photo in which no bead can be told from the plate; the results, if
    asked for, then say why.
    """
    from seamlog.analysis.bead.assess import assess_photos
    from seamlog.analysis.bead.part import BeadConfig
    from seamlog.config import load_config

    _check_output(output, force)
    settled = load_config(BeadConfig, "bead", config, settings)
    sources = _sources(photos, session, calibration)
    assessed = assess_photos(sources, start, settled, weld)
    if output is not None:
        _write(output, assessed)
    if len(assessed) == 1 and assessed[0].refusal is not None:
        raise assessed[0].refusal
    return _outcome(assessed, output)


bead.add_command(measure)


def _check_output(output: Path | None, force: bool) -> None:
    if output is not None and output.is_dir() and any(output.glob("bead*.json")) and not force:
        raise OutputExists(f"{output} holds a bead already; give another name or --force")


def _sources(photos: tuple[Path, ...], session: Path | None, calibration: Path | None) -> list[Any]:
    from seamlog.analysis.bead.sources import attached_photos, photo_files
    from seamlog.session import open_session

    if photos:
        return photo_files(photos, calibration)
    if session is None:
        raise UsageError("no PHOTO and no --session; name a photo of the bead")
    with open_session(session) as opened:
        found = attached_photos(opened, calibration)
    if not found:
        raise EvidenceError(
            f"{session} has no photo attached; name one, or put one in with 'seamlog attach'"
        )
    return found


def _write(output: Path, assessed: list["AssessedPhoto"]) -> None:
    from seamlog.results import Results

    results = Results.create(output)
    for path in output.glob("bead*.json"):
        path.unlink()
    for item in assessed:
        results.write(item.part, item.tables, item.pictures)


def _outcome(assessed: list["AssessedPhoto"], output: Path | None) -> Outcome:
    documents = [item.summary() for item in assessed]
    lines = [line for document in documents for line in _lines(document)]
    if output is not None:
        lines.append(f"Results: {output}")
    failed = any(document["verdict"] == "FAIL" for document in documents)
    refused = any(item.refusal is not None for item in assessed)
    ending = Ending.FINDING if failed else Ending.BATCH_FAILED if refused else Ending.PASS
    document = {"photos": documents, "results": str(output) if output else None}
    return Outcome("seamlog.bead.measure", "\n".join(lines), document, ending)


def _lines(document: dict[str, Any]) -> list[str]:
    lines = [f"{document['photo']}: {document['verdict']}"]
    if document["refused"]:
        return [*lines, f"  refused: {document['refused']}"]
    unit = document["unit"]
    mean, u = document[f"mean_width_{unit}"], document["u_mean_width"]
    doubt = "" if document["confidence"] >= document["trusted_from"] else ", DOUBTFUL"
    lines.append(
        "  no width could be measured"
        if mean is None
        else f"  mean width {mean:.4g} +- {u:.2g} {unit} (confidence "
        f"{document['confidence']:.2f}{doubt}), standard deviation {document['width_std']:.3g} "
        f"{unit}, range {document['range']:.3g} {unit}"
    )
    lines.append(f"  {document['stations']} stations, {document['flagged']} flagged")
    lines.append(f"  toes: {document['toe_definition']}")
    return [*lines, *(f"  warning: {text}" for text in document["warnings"])]
