"""`seamlog bead grr`: how much of a measured difference is the measurement's own."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, config_options, force_option, output_option
from seamlog.errors import OutputExists, UsageError
from seamlog.outcome import Ending, Outcome
from seamlog.progress import spinner

if TYPE_CHECKING:
    from seamlog.analysis.bead.part import BeadConfig, BeadResult
    from seamlog.analysis.gauge.study import Study
    from seamlog.results import Input, Part


@command("grr")
@click.argument("photos", nargs=-1, type=click.Path(path_type=Path), metavar="[PHOTO]...")
@click.option(
    "--study",
    type=click.Path(path_type=Path),
    help="CSV with columns part, operator (optional), and photo or width_mm.",
)
@click.option("--tolerance-mm", type=float, help="Upper minus lower limit of the width.")
@click.option(
    "--calibration",
    type=click.Path(path_type=Path),
    help="Calibration of all photos; default: <photo>.calibration.json beside each.",
)
@output_option("Results directory.", required=False)
@config_options
@force_option
def grr(
    photos: tuple[Path, ...],
    study: Path | None,
    tolerance_mm: float | None,
    calibration: Path | None,
    output: Path | None,
    config: Path | None,
    settings: tuple[str, ...],
    force: bool,
) -> Outcome:
    """Gauge R&R (ANOVA, AIAG) from repeat PHOTOs of one bead, or from a --study of several.

    With PHOTOs the parts are stretches of the bead, 5 mm long, and every photo is a trial: take the
    camera away and put it back between them. A study crosses parts, operators and trials.
    """
    from seamlog.analysis.bead.part import BeadConfig
    from seamlog.analysis.gauge.anova import gauge_rr
    from seamlog.analysis.gauge.part import gauge_part
    from seamlog.config import load_config
    from seamlog.results import Results

    if output is not None and (output / "gauge.json").exists() and not force:
        raise OutputExists(f"{output} holds a gauge study already; give another name or --force")
    if bool(photos) == bool(study):
        raise UsageError("give either PHOTOs of one bead or a --study")
    if tolerance_mm is not None and tolerance_mm <= 0:
        raise UsageError(f"a tolerance of {tolerance_mm:g} mm cannot be")
    settled = load_config(BeadConfig, "bead", config, settings)
    with spinner("measuring"):
        done, inputs = (
            _from_table(study, calibration, settled)
            if study
            else _from_photos(photos, calibration, settled)
        )
    if tolerance_mm is not None and done.unit != "mm":
        raise UsageError("the photos have no calibration, so a tolerance in mm says nothing")
    part, tables = gauge_part(done, gauge_rr(done.values), tolerance_mm, inputs)
    if output is not None:
        Results.create(output).write(part, tables)
    return _outcome(part, output)


def _from_photos(
    photos: tuple[Path, ...], calibration: Path | None, config: "BeadConfig"
) -> tuple["Study", list["Input"]]:
    from seamlog.analysis.gauge.study import places_along

    results, inputs = _measured(photos, calibration, config)
    found = places_along([r.measurement for r in results], [r.photo for r in results])
    return found, inputs


def _from_table(
    path: Path, calibration: Path | None, config: "BeadConfig"
) -> tuple["Study", list["Input"]]:
    from seamlog.analysis.gauge.study import crossed, read_study
    from seamlog.errors import EvidenceError
    from seamlog.results import input_of

    trials = read_study(path)
    inputs = [input_of(path)]
    photos = tuple(trial.photo for trial in trials if trial.photo is not None)
    if not photos:
        return crossed(trials, [trial.value or 0.0 for trial in trials], "mm"), inputs
    results, more = _measured(photos, calibration, config)
    units = {result.measurement.unit for result in results}
    if len(units) != 1:
        raise EvidenceError("some photos have a calibration and others have none")
    values = [result.uniformity.mean for result in results if result.uniformity is not None]
    if len(values) != len(trials):
        raise EvidenceError("on some photos no width could be measured; leave them out")
    return crossed(trials, values, units.pop()), [*inputs, *more]


def _measured(
    photos: tuple[Path, ...], calibration: Path | None, config: "BeadConfig"
) -> tuple[list["BeadResult"], list["Input"]]:
    """Every photo has to be measurable: a study with holes says nothing."""
    from seamlog.analysis.bead.part import measure_photo
    from seamlog.analysis.bead.sources import photo_files

    sources = photo_files(photos, calibration)
    results = [measure_photo(each.photo, each.calibration, None, config) for each in sources]
    inputs = {item.sha256: item for source in sources for item in source.inputs}
    return results, list(inputs.values())


def _outcome(part: "Part", output: Path | None) -> Outcome:
    figures: dict[str, Any] = {figure.name: figure.value for figure in part.figures}
    lines = [f"{part.title}: {part.verdict.value} ({part.reason})"]
    for figure in part.figures:
        value = "not known" if figure.value is None else f"{figure.value:.4g} {figure.unit}"
        lines.append(
            f"  {figure.label}: {value}" + (f" ({figure.reason})" if figure.reason else "")
        )
    if output is not None:
        lines.append(f"Results: {output}")
    document = {
        "verdict": part.verdict.value,
        "study": part.reason,
        "figures": figures,
        "results": str(output) if output else None,
    }
    ending = Ending.FINDING if part.verdict.value == "FAIL" else Ending.PASS
    return Outcome("seamlog.bead.grr", "\n".join(lines), document, ending)
