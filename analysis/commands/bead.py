"""`seamlog bead`: measure beads on photos."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, config_options, force_option, group, output_option
from seamlog.errors import EvidenceError, OutputExists, UsageError
from seamlog.outcome import Ending, Outcome

from .bead_grr import grr
from .bead_synth import synth

if TYPE_CHECKING:
    from seamlog.analysis.bead.assess import AssessedPhoto
    from seamlog.analysis.bead.plane import Points
    from seamlog.analysis.bead.sources import Before
    from seamlog.analysis.inspection import Inspected
    from seamlog.results import Columns


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
@click.option(
    "--before",
    type=click.Path(path_type=Path),
    help="Photo of the plate from before welding; default: the session's last picture before "
    "the arc, if it shows this plate.",
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
    before: Path | None,
    output: Path | None,
    config: Path | None,
    settings: tuple[str, ...],
    force: bool,
) -> Outcome:
    """Measure width and surface of the bead on PHOTOs, in mm with a calibration, else in px.

    Limits come from the sections [bead] and [quality] of the configuration. Refuses (exit code 6)
    a photo in which no bead can be told from the plate; the results, if asked for, then say why.
    """
    from seamlog.analysis.bead.assess import AssessedPhoto, assess_photos
    from seamlog.analysis.bead.image import load_photo
    from seamlog.analysis.bead.part import BeadConfig
    from seamlog.analysis.bead.sources import Before
    from seamlog.analysis.inspection import InspectionSettings, inspect_photos, stitched
    from seamlog.analysis.quality.part import QualityConfig
    from seamlog.analysis.surface.heights import heights_of
    from seamlog.config import load_config

    _check_output(output, force)
    settled = load_config(BeadConfig, "bead", config, settings)
    quality = load_config(QualityConfig, "quality", config, settings)
    named = Before(load_photo(before), was_named=True) if before else None
    profiles, logged = _logged(session, weld)
    sources = _sources(photos, session, calibration)
    assessed = assess_photos(sources, start, settled, weld, _seam_mm(session))
    whole = stitched(assessed, settled)
    if isinstance(whole, AssessedPhoto):
        assessed = [*assessed, whole]
    heights = heights_of(profiles[0]) if profiles else ()
    parts = inspect_photos(assessed, InspectionSettings(quality, named or logged, heights))
    parts += [profiles] if profiles else []
    if output is not None:
        _write(output, parts)
    if len(assessed) == 1 and assessed[0].refusal is not None:
        raise assessed[0].refusal
    return _outcome(assessed, parts, output, whole if isinstance(whole, str) else "")


for _act in (measure, grr, synth):
    bead.add_command(_act)


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


def _logged(session: Path | None, number: int | None) -> "tuple[Inspected | None, Before | None]":
    """Laser profiles of the weld and a picture from before it, if the session has some."""
    from seamlog.analysis.bead.sources import frame_before
    from seamlog.analysis.surface.heights import heights_part
    from seamlog.analysis.welds import chosen_welds
    from seamlog.session import open_session

    if session is None:
        return None, None
    with open_session(session) as opened:
        welds = chosen_welds(opened, number)
        before = frame_before(opened, welds[0].start_ns) if welds else None
        return heights_part(opened, welds[0] if len(welds) == 1 else None), before


def _seam_mm(session: Path | None) -> "Points | None":
    from seamlog.analysis.bead.sources import logged_seam_mm
    from seamlog.session import open_session

    if session is None:
        return None
    with open_session(session) as opened:
        return logged_seam_mm(opened)


def _write(output: Path, parts: list["Inspected"]) -> None:
    """All parts, and the widths as CSV beside their Parquet table."""
    from seamlog.results import Results

    results = Results.create(output)
    for kind in ("bead", "surface", "quality", "profile"):
        for path in output.glob(f"{kind}*.json"):
            path.unlink()
    for part, tables, pictures in parts:
        written = results.write(part, tables, pictures)
        if part.part == "bead" and "stations" in tables:
            _write_csv(output / f"{written.stem}.stations.csv", tables["stations"][0])


def _write_csv(path: Path, columns: "Columns") -> None:
    import pandas as pd

    from seamlog.files import write_bytes

    write_bytes(path, pd.DataFrame(dict(columns)).to_csv(index=False).encode())


def _outcome(
    assessed: list["AssessedPhoto"], parts: list["Inspected"], output: Path | None, apart: str
) -> Outcome:
    """`apart` says why several photos were not stitched into one bead."""
    documents = [_document(item, parts) for item in assessed]
    lines = [line for document in documents for line in _lines(document)]
    if apart:
        lines.append(f"Not stitched into one bead: {apart}")
    if output is not None:
        lines.append(f"Results: {output}")
    failed = any(document["verdict"] == "FAIL" for document in documents)
    refused = any(item.refusal is not None for item in assessed)
    undecided = any(each["limits"] and each["verdict"] != "PASS" for each in documents)
    ending = Ending.BATCH_FAILED if refused else Ending.PASS
    if failed or undecided:
        ending = Ending.FINDING if failed else Ending.NO_EVIDENCE
    document = {
        "photos": documents,
        "not_stitched": apart,
        "results": str(output) if output else None,
    }
    return Outcome("seamlog.bead.measure", "\n".join(lines), document, ending)


def _document(item: "AssessedPhoto", parts: list["Inspected"]) -> dict[str, Any]:
    """Summary of a photo with its surface and each judged limit; the verdict is the worst."""
    from seamlog.results import worst

    own = {part.part: part for part, _, _ in parts if part.index == item.part.index}
    judged = [part.verdict for part in own.values() if part.criteria]
    surface = own["surface"].figures if "surface" in own else []
    criteria = [criterion for part in own.values() for criterion in part.criteria]
    verdict = worst(judged) if judged else item.part.verdict
    return item.summary() | {
        "verdict": verdict.value,
        "surface": {figure.name: figure.value for figure in surface},
        "limits": [
            criterion.model_dump(mode="json", include={"name", "value", "verdict", "reason"})
            for criterion in criteria
        ],
    }


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
    other = document["mean_width_by_other_toe"]
    if mean and other:
        change = 100 * (other / mean - 1)
        lines.append(f"  by the {document['other_toe']} toe: {other:.4g} {unit} ({change:+.1f} %)")
    if document["surface"].get("spatter_count") is not None:
        lines.append(f"  spatter: {document['surface']['spatter_count']} drops")
    lines += [
        f"  {limit['verdict']}: {limit['name']} {limit['reason']}".rstrip()
        for limit in document["limits"]
    ]
    return [*lines, *(f"  warning: {text}" for text in document["warnings"])]
