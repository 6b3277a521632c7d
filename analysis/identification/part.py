"""An identification as a part of the results."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.part_tables import Tables
from seamlog.results import Figure, Finding, Input, Part, Severity

from .compare import Comparison
from .excitation import Excitation, refused_values
from .friction_models import SYMMETRIC, unit_of
from .method import Identification
from .residuals import Dependence, ResidualAnalysis
from .selection import Selection
from .validation import Validation

Columns = Mapping[str, NDArray[Any]]
_PARAMETERS = ("inertia", "viscous_friction", "coulomb_friction")
_TOLD_CANDIDATES = 12
_NOTABLE_SHARE = 0.05
"""Share of the residual's variance that follows place or speed and is worth a warning."""
_SIMULATED = {
    ("closed_loop", "position_error"): ("simulated_position_error", "%"),
    ("closed_loop", "velocity_error"): ("simulated_velocity_error", "%"),
    ("closed_loop", "force_error"): ("simulated_force_error", "%"),
    ("open_loop", "position_rms_mm"): ("open_loop_position_rms", "mm"),
    ("servo", "replay_error"): ("servo_replay_error", "%"),
}


@dataclass(frozen=True)
class Doubts:
    """What speaks for and against an identification."""

    excitation: Excitation
    residual: ResidualAnalysis
    selection: Selection | None


def identification_part(
    found: Identification,
    why: str,
    doubts: Doubts,
    comparison: list[Comparison],
    inputs: list[Input],
    validation: Validation | None = None,
) -> tuple[Part, Tables]:
    """The part `identification` with its tables of residuals."""
    verdict = doubts.excitation.verdict
    part = Part(
        part="identification",
        title="Axis identification",
        reason=f"{found.method} ({why}); excitation {verdict}; no limits were given",
        inputs=inputs,
        configuration={"friction": found.friction, **found.settings},
        figures=[
            *figures(found),
            *_residual_figures(doubts.residual),
            *_simulation_figures(found.extras),
            *(_validation_figures(validation) if validation else []),
        ],
        findings=_findings(found, doubts),
        details={
            "method": found.method,
            "why": why,
            "delay_periods": found.delay_periods,
            "excitation": asdict(doubts.excitation),
            "comparison": [asdict(row) for row in comparison],
            "selection": _selection(doubts.selection),
            **found.extras,
        },
    )
    return part, _tables(found, doubts.residual)


def refused_part(reason: str, inputs: list[Input]) -> Part:
    """The part where the record could not tell: figures without value, and why."""
    none = [_figure(name, None, None, "", reason) for name in SYMMETRIC]
    return Part(
        part="identification",
        title="Axis identification",
        reason=reason,
        inputs=inputs,
        figures=none,
    )


def figures(found: Identification) -> list[Figure]:
    """Parameters with standard uncertainty, then what tells how good the fit is."""
    fit, refused = found.fit, refused_values(found)
    unit = "m" if _compares_positions(found) else found.unit
    return [
        *(_parameter(found, name, refused.get(name, "")) for name in fit.names),
        _figure("condition_number", fit.condition_number, None, ""),
        _figure("residual_norm", fit.residual_norm, None, unit),
        _figure("relative_error", 100 * fit.relative_error, None, "%"),
        _figure("used_share", 100 * found.motion.share, None, "%"),
    ]


def _parameter(found: Identification, name: str, refused: str) -> Figure:
    unit = unit_of(name, found.unit)
    if refused:
        return _figure(name, None, None, unit, refused)
    return _figure(name, found.fit.value(name), found.fit.deviation(name), unit)


def _figure(name: str, value: float | None, u: float | None, unit: str, reason: str = "") -> Figure:
    label = name.replace("_", " ").replace("coulomb", "Coulomb").replace("stribeck", "Stribeck")
    label = label.replace(" mm s", " mm/s")
    label = {
        "used share": "share of the record used",
        "residual by position": "residual that follows place",
        "residual by speed": "residual that follows speed",
        "residual alike": "residual, next row alike",
        "servo replay error": "commands recomputed",
    }.get(label, label)
    return Figure(name=name, label=label, value=value, u=u, unit=unit, reason=reason)


def _residual_figures(residual: ResidualAnalysis) -> list[Figure]:
    return [
        _figure("residual_alike", float(residual.autocorrelation[0]), None, ""),
        _figure("residual_by_position", 100 * residual.by_position.share, None, "%"),
        _figure("residual_by_speed", 100 * residual.by_speed.share, None, "%"),
    ]


def _simulation_figures(extras: dict[str, Any]) -> list[Figure]:
    return [
        _figure(name, extras[group][key], None, unit)
        for (group, key), (name, unit) in _SIMULATED.items()
        if group in extras
    ]


def _validation_figures(validation: Validation) -> list[Figure]:
    simulated = _simulation_figures(validation.simulation)
    renamed = [
        _figure(f"other_record_{figure.name}", float(figure.value or 0.0), None, figure.unit)
        for figure in simulated
    ]
    return [_figure("other_record_force_error", validation.force_error, None, "%"), *renamed]


def _findings(found: Identification, doubts: Doubts) -> list[Finding]:
    told = [(Severity.WARNING, text) for text in doubts.excitation.reasons]
    told += [(Severity.INFO, note) for note in found.notes]
    residual, selection = doubts.residual, doubts.selection
    for name, dependence in (("place", residual.by_position), ("speed", residual.by_speed)):
        if dependence.is_sure and dependence.share > _NOTABLE_SHARE:
            share = 100 * dependence.share
            text = f"{share:.0f} % of the residual's variance follows {name}: the model lacks that"
            told.append((Severity.WARNING, text))
    if not residual.is_white:
        text = (
            "the residual is not white (Ljung-Box): standard deviations allow for neighbouring "
            f"rows that err alike, as if there were {residual.effective_rows:.0f} rows"
        )
        told.append((Severity.INFO, text))
    if selection is not None:
        told.append((Severity.INFO, f"model selection: {selection.reason}"))
    return [Finding(severity=severity, message=text) for severity, text in told]


def _selection(selection: Selection | None) -> dict[str, Any] | None:
    if selection is None:
        return None
    return {
        "chosen": selection.chosen.friction,
        "lag_periods": selection.chosen.lag_periods,
        "reason": selection.reason,
        "candidates": [
            {
                "friction": one.friction,
                "lag_periods": one.lag_periods,
                "parameters": one.parameters,
                "left_out_error": one.left_out_error,
                "fitted_error": one.fitted_error,
            }
            for one in selection.candidates[:_TOLD_CANDIDATES]
        ],
    }


def _tables(found: Identification, residual: ResidualAnalysis) -> Tables:
    unit, fit = found.unit, found.fit
    forces = dict.fromkeys(("force", "predicted_force", "residual"), unit)
    tables: Tables = {}
    if not _compares_positions(found):
        columns = {
            "stamp_ns": found.stamp_ns,
            "force": fit.measured,
            "predicted_force": fit.predicted,
            "residual": fit.residual,
        }
        tables["residual"] = (columns, {"stamp_ns": "ns"} | forces)
    tables["residual_by_position"] = _binned(residual.by_position, "position_mm", "mm", unit)
    tables["residual_by_speed"] = _binned(residual.by_speed, "speed_mm_s", "mm/s", unit)
    return tables


def _compares_positions(found: Identification) -> bool:
    """Whether the rows of the fit are positions (open loop), not forces."""
    return found.settings.get("loop") == "open"


def _binned(
    bins: Dependence, along: str, along_unit: str, unit: str
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    columns = {along: np.round(1e3 * bins.centre, 3), "mean_residual": bins.mean, "sd": bins.sd}
    return columns, {along: along_unit, "mean_residual": unit, "sd": unit}


def estimator_table(state: Columns, unit: str) -> Tables:
    """Table `estimator`: what the live estimator said, in the command's unit."""
    units = dict(zip(_PARAMETERS, (f"{unit} s^2/m", f"{unit} s/m", unit), strict=True))
    columns: dict[str, NDArray[Any]] = {"stamp_ns": state["stamp_ns"]}
    for name in _PARAMETERS:
        columns[name] = state[name]
        with np.errstate(invalid="ignore"):
            columns[f"u_{name}"] = np.sqrt(state[f"var_{name}"])
    columns["prediction_error"] = state["prediction_error"]
    doubts = {f"u_{name}": value for name, value in units.items()}
    return {"estimator": (columns, {"stamp_ns": "ns", "prediction_error": unit} | units | doubts)}
