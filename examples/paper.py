"""Figures 3 to 6, 8, 9 and 11 of the paper, from seamlog's own code, as one report.

`python examples/paper.py OUT` writes OUT/paper.results and OUT/paper.html; `--quick` leaves out
Fig. 11 (a whole virtual weld with its photo) and shortens the runs. docs/paper.md says what agrees.
The paper prints no parameters: these are the ones of the axis bench, in N and m.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.closed_loop import ClosedLoop, Reference, simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.estimators.gated_rls import GatedRLS, GatedRLSConfig
from seamlog.analysis.estimators.paper import PaperEstimator, PaperEstimatorConfig
from seamlog.analysis.friction import friction_shape, sliding_friction, smallest_dead_zone_m_s
from seamlog.cli import invoke
from seamlog.clock import SIMULATED_EPOCH_NS
from seamlog.contracts import Axis, Estimator
from seamlog.results import Figure, Finding, Part, Results, Severity

Floats = NDArray[np.float64]
AXIS = Axis(1.0, 2.14, 0.214, 0.0, 0.257, 0.002, saturation=20.0)
PERIOD_S = 0.04
DEAD_ZONE_M_S = 0.007
PRINTED_FILTER_1_S = 0.75
"""lambda_f of eq. 24: (1 - 0.97) / 0.04 s."""
UNITS = {"inertia": "N s^2/m", "viscous_friction": "N s/m", "coulomb_friction": "N"}


TRACKING = {
    "surface_slope": 3.489,
    "gain": 0.2335,
    "boundary_layer": 0.0059,
    "dead_zone_m_s": 0.003916,
}
"""The best of 1,500 random tunings of the right form on the axis bench (benchmarks/)."""


@dataclass(frozen=True)
class Shown:
    """One figure's counterpart: the part and its tables."""

    part: Part
    tables: dict[str, tuple[dict[str, NDArray[Any]], dict[str, str]]]


def stamps(count: int, period_s: float) -> NDArray[np.int64]:
    """Stamps of an even grid from the fixed epoch."""
    return np.asarray(
        SIMULATED_EPOCH_NS + np.rint(1e9 * period_s * np.arange(count)).astype(np.int64)
    )


def sine(amplitude_m: float, rate_rad_s: float, seconds: float, period_s: float) -> Reference:
    """A sinusoidal reference."""
    angle = rate_rad_s * period_s * np.arange(round(seconds / period_s))
    return Reference(
        amplitude_m * np.sin(angle),
        amplitude_m * rate_rad_s * np.cos(angle),
        -amplitude_m * rate_rad_s**2 * np.sin(angle),
    )


def friction_figures() -> list[Shown]:
    """Figs. 3 to 5: speed runs from -20 to 20 mm/s, 1 mm/s in each second."""
    speed = np.linspace(-0.02, 0.02, 4001)
    direction = np.sign(speed)
    dry = direction * np.array([sliding_friction(AXIS, abs(v)) for v in speed.tolist()])
    shape = np.array([friction_shape(v, DEAD_ZONE_M_S) for v in speed.tolist()])
    viscous = AXIS.viscous_friction * speed
    stribeck, used = viscous + dry, viscous + AXIS.coulomb_friction * shape
    unmodelled = stribeck - used
    bound = AXIS.static_friction * (1 - np.abs(shape))
    time = {"stamp_ns": stamps(len(speed), 0.01), "speed_mm_s": 1e3 * speed}
    newton = {"speed_mm_s": "mm/s"}
    note = "the speed rises by 1 mm/s in each second"
    least = 1e3 * smallest_dead_zone_m_s(AXIS)
    excess = float(np.max(np.abs(unmodelled) - bound))
    return [
        _shown(
            "figure_03",
            f"Stribeck friction model (eq. 2); {note}",
            {"friction": ({**time, "friction": stribeck}, newton | {"friction": "N"})},
        ),
        _shown(
            "figure_04",
            f"friction model used (eq. 3) and Stribeck friction (eq. 2); {note}",
            {
                "friction": (
                    {**time, "stribeck": stribeck, "used": used},
                    newton | {"stribeck": "N", "used": "N"},
                )
            },
        ),
        _shown(
            "figure_05",
            f"what eq. 3 leaves over, and its bound F_s (1 - |s|) (eq. 5 with |f|); {note}",
            {
                "error": (
                    {**time, "left": unmodelled, "upper": bound, "lower": -bound},
                    newton | dict.fromkeys(("left", "upper", "lower"), "N"),
                )
            },
            [
                Figure(name="largest", label="largest |f|", value=_peak(unmodelled), unit="N"),
                Figure(name="beyond", label="|f| beyond its bound", value=excess, unit="N"),
                Figure(name="least_alpha", label="least alpha for eq. 5", value=least, unit="mm/s"),
            ],
        ),
    ]


def estimation_figures(quick: bool) -> list[Shown]:
    """Fig. 6 (no noise, 1 ms, large gains) and Fig. 8 (40 ms, noise, delay, small gains)."""
    seconds = 120.0 if quick else 300.0
    ideal = Axis(AXIS.inertia, AXIS.viscous_friction, AXIS.coulomb_friction, delay_periods=0)
    fine_s = 1e-3
    pole = 1 - PRINTED_FILTER_1_S * fine_s
    large = {"filter_pole": pole, "initial_gain": 300.0, "gain_bound": 1e6, "forgetting_rate": 5.0}
    large |= {"settle_s": 0.0, "dead_zone_m_s": 1e-5}
    small = {"initial_gain": 5.0, "gain_bound": 1e3, "forgetting_rate": 0.2}
    printed = {"form": "as_printed", "speed_unit": "m/s"}
    at_once = PaperConfig(friction_speed="reference", dead_zone_m_s=1e-5)
    fine = _identification_run(ideal, at_once, 10.0, fine_s, 0.0)
    loop = _identification_run(AXIS, PaperConfig(), seconds, PERIOD_S, 5e-4)
    return [
        _estimation(
            "figure_06",
            "estimator in a simulation without noise and lag, 1 ms, large gains",
            fine,
            {
                "right": _paper_estimator(large, fine_s),
                "as_printed": _paper_estimator(large | printed, fine_s),
            },
            (fine_s, 0),
        ),
        _estimation(
            "figure_08",
            "estimators in the loop: 40 ms, delay, 0.5 mm/s of speed noise, Stribeck friction",
            loop,
            {
                "right": _paper_estimator(small, PERIOD_S),
                "as_printed": _paper_estimator(small | printed, PERIOD_S),
                "gated": GatedRLS(GatedRLSConfig(), PERIOD_S),
            },
            (PERIOD_S, AXIS.delay_periods),
        ),
    ]


def _paper_estimator(values: dict[str, Any], period_s: float) -> PaperEstimator:
    return PaperEstimator(PaperEstimatorConfig.model_validate(values), period_s)


def _identification_run(
    axis: Axis, config: PaperConfig, seconds: float, period_s: float, noise_m_s: float
) -> ClosedLoop:
    """100 sin t mm under the paper's law."""
    reference = sine(0.1, 1.0, seconds, period_s)
    noise = np.random.default_rng(0).normal(0.0, 1.0, len(reference.position_m)) * noise_m_s
    law = PaperController(config, axis, period_s)
    return simulate(law, axis, reference, period_s, velocity_noise_m_s=noise)


def _estimation(
    name: str,
    title: str,
    run: ClosedLoop,
    estimators: dict[str, Estimator],
    loop: tuple[float, int],
) -> Shown:
    period_s, _ = loop
    traces = {form: _trace(estimator, run) for form, estimator in estimators.items()}
    time = {"stamp_ns": stamps(len(run.command), period_s)}
    tables = {}
    figures = []
    for place, (quantity, unit) in enumerate(UNITS.items()):
        truth = getattr(AXIS, quantity)
        columns = {f"{quantity}_{form}": trace[:, place] for form, trace in traces.items()}
        true = np.full(len(run.command), truth)
        tables[quantity] = (
            {**time, **columns, "true": true},
            dict.fromkeys([*columns, "true"], unit),
        )
        for column_name, column in columns.items():
            share = float(np.mean(column[-len(column) // 10 :])) / truth
            label = f"{column_name.replace('_', ' ')}: estimate / truth"
            figures.append(Figure(name=column_name, label=label, value=share))
    errors = {f"{form}_error": trace[:, 3] for form, trace in traces.items()}
    tables["prediction_error"] = ({**time, **errors}, dict.fromkeys(errors, "N"))
    return _shown(name, title, tables, figures)


def _trace(estimator: Estimator, run: ClosedLoop) -> Floats:
    """Parameters and prediction error after each sample, shape (n, 4)."""
    rows = []
    before = 0.0
    motion = (run.measured_position_m, run.measured_velocity_m_s, run.applied_command)
    for position, velocity, applied in zip(*(column.tolist() for column in motion), strict=True):
        error = estimator.update(position, velocity, before)
        rows.append((*estimator.parameters(), error))
        before = applied
    return np.array(rows)


def tracking_figure(quick: bool) -> Shown:
    """Fig. 9: 100 sin 0.6t mm under the paper's law, right and as printed."""
    reference = sine(0.1, 0.6, 30.0 if quick else 60.0, PERIOD_S)
    noise = np.random.default_rng(1).normal(0.0, 5e-4, len(reference.position_m))
    time = {"stamp_ns": stamps(len(noise), PERIOD_S)}
    paths: dict[str, Floats] = {"reference_mm": 1e3 * reference.position_m}
    errors: dict[str, Floats] = {}
    figures = []
    for form in ("right", "as_printed"):
        config = PaperConfig.model_validate(TRACKING | {"form": form})
        law = PaperController(config, AXIS, PERIOD_S)
        run = simulate(
            law, AXIS, reference, PERIOD_S, velocity_noise_m_s=noise, encoder_step_m=1e-6
        )
        paths[f"{form}_mm"] = 1e3 * run.position_m
        error = errors[f"{form}_error_mm"] = 1e3 * run.tracking_error_m(reference)
        late = error[250:]
        for kind, value in (("peak", _peak(late)), ("rms", float(np.sqrt(np.mean(late**2))))):
            label = f"{kind} tracking error after 10 s, {form.replace('_', ' ')}"
            figures.append(Figure(name=f"{form}_{kind}_mm", label=label, value=value, unit="mm"))
    return _shown(
        "figure_09",
        "tracking of 100 sin 0.6t mm under the paper's law",
        {
            "path": ({**time, **paths}, dict.fromkeys(paths, "mm")),
            "error": ({**time, **errors}, dict.fromkeys(errors, "mm")),
        },
        figures,
    )


def bead_figure(folder: Path) -> None:
    """Fig. 11: width along the bead of a virtual weld, measured on its photo."""
    weld, results = str(folder / "weld.mcap"), str(folder / "paper.results")
    photo, plane = str(folder / "weld.bead.jpg"), str(folder / "weld.bead.calibration.json")
    invoke(["record", "--source", "virtual-cell", "-o", weld, "--force"])
    invoke(["attach", weld, photo, plane, "--force"])
    invoke(["bead", "measure", "--session", weld, "--start", "left", "-o", results, "--force"])


def _peak(values: Floats) -> float:
    return float(np.max(np.abs(values)))


def _shown(
    name: str, title: str, tables: dict[str, Any], figures: list[Figure] | None = None
) -> Shown:
    number = int(name.removeprefix("figure_"))
    finding = Finding(
        severity=Severity.INFO,
        message=f"counterpart of Fig. {number} of the paper, which prints no parameters",
    )
    part = Part(
        part=name,
        title=f"Fig. {number}",
        reason=title,
        figures=figures or [],
        findings=[finding],
    )
    return Shown(part, tables)


def main(folder: Path, quick: bool) -> Path:
    """Write results and report into `folder`; returns the report's path."""
    folder.mkdir(parents=True, exist_ok=True)
    results = Results.create(folder / "paper.results")
    for shown in (*friction_figures(), *estimation_figures(quick), tracking_figure(quick)):
        results.write(shown.part, shown.tables)
    if not quick:
        bead_figure(folder)
    report = folder / "paper.html"
    invoke(["report", str(results.folder), "-o", str(report), "--force"])
    return report


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    sys.stdout.write(f"{main(arguments.folder, arguments.quick)}\n")
