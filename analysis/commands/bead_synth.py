"""`seamlog bead synth`: rendered beads with exact truth, to check one's own set-up."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, config_options, force_option, output_option
from seamlog.errors import OutputExists, UnknownName, UsageError
from seamlog.outcome import Outcome

if TYPE_CHECKING:
    from seamlog.analysis.bead.synthetic import Scene, SyntheticBead


@command("synth")
@click.option("--case", default="clean", show_default=True, help="A case of the benchmarks.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the first bead.")
@click.option("--count", type=int, default=1, show_default=True, help="Beads of seeds that follow.")
@output_option("Folder for photos, calibrations and truth.")
@config_options
@force_option
def synth(
    case: str,
    seed: int,
    count: int,
    output: Path,
    config: Path | None,
    settings: tuple[str, ...],
    force: bool,
) -> Outcome:
    """Render beads with exactly known widths, each with its calibration and truth (CSV).

    Everything of a scene can be set, such as --set synth.noise=8 --set synth.mm_per_px=0.05:
    make it like your own photos, measure it, and see what your set-up can tell.
    """
    from seamlog.analysis.bead.synthetic import CASES, render

    if case not in CASES:
        raise UnknownName(f"no case {case!r}; there are: {', '.join(CASES)}")
    if count < 1:
        raise UsageError(f"{count} beads cannot be rendered")
    scene = _scene(CASES[case], config, settings)
    stem = case.replace(" + ", "_").replace(" ", "_")
    names = [f"{stem}_{number}" for number in range(seed, seed + count)]
    taken = [name for name in names if (output / f"{name}.png").exists()]
    if taken and not force:
        raise OutputExists(f"{output} holds {taken[0]}.png already; give another name or --force")
    output.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(names, seed):
        _write(output / name, render(scene, number))
    lines = [f"{output / name}.png" for name in names]
    document = {"photos": lines, "scene": asdict(scene)}
    lines.append("Truth: <name>.truth.csv, a row each 0.25 mm along the seam")
    return Outcome("seamlog.bead.synth", "\n".join(lines), document)


def _scene(base: "Scene", config: Path | None, settings: tuple[str, ...]) -> "Scene":
    """The case with what the section `synth` of the configuration changes."""
    from pydantic import ConfigDict, create_model

    from seamlog.config import load_config

    fields: dict[str, Any] = {name: (type(value), value) for name, value in asdict(base).items()}
    model = create_model("SynthConfig", __config__=ConfigDict(extra="forbid"), **fields)
    settled = load_config(model, "synth", config, settings)
    scene = replace(base, **settled.model_dump())
    pixels = scene.width_px * scene.height_px
    if min(scene.width_px, scene.height_px) < 64 or pixels > 60_000_000 or scene.mm_per_px <= 0:
        raise UsageError(
            f"{scene.width_px} x {scene.height_px} px of {scene.mm_per_px:g} mm cannot be rendered"
        )
    return scene


def _write(stem: Path, bead: "SyntheticBead") -> None:
    import cv2
    import numpy as np
    import pandas as pd

    from seamlog.files import write_bytes

    done, data = cv2.imencode(".png", bead.pixels)
    assert done
    write_bytes(stem.with_name(f"{stem.name}.png"), data.tobytes())
    calibration = bead.calibration.model_dump_json(by_alias=True, indent=1) + "\n"
    write_bytes(stem.with_name(f"{stem.name}.calibration.json"), calibration.encode())
    s_mm = np.arange(bead.s_mm[0], bead.s_mm[-1], 0.25)
    truth = {
        "s_mm": s_mm,
        **{
            name: np.interp(s_mm, bead.s_mm, getattr(bead, name))
            for name in ("x_mm", "y_mm", "left_mm", "right_mm")
        },
    }
    truth["width_mm"] = truth["left_mm"] + truth["right_mm"]
    for first, last in bead.gaps_mm:
        truth["width_mm"][(s_mm >= first) & (s_mm < last)] = np.nan
    px = bead.calibration.px(np.column_stack([truth["x_mm"], truth["y_mm"]]))
    truth |= {"x_px": px[:, 0], "y_px": px[:, 1]}
    table = pd.DataFrame(truth).to_csv(index=False, float_format="%.5f")
    write_bytes(stem.with_name(f"{stem.name}.truth.csv"), table.encode())
