"""An identification as a part of the results."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.part_tables import Tables
from seamlog.results import Figure, Finding, Input, Part, Severity

from .compare import Comparison
from .excitation import Excitation, refused_values
from .method import SYMMETRIC, Identification, unit_of

Columns = Mapping[str, NDArray[Any]]
_PARAMETERS = ("inertia", "viscous_friction", "coulomb_friction")


def identification_part(
    found: Identification,
    why: str,
    excitation: Excitation,
    comparison: list[Comparison],
    inputs: list[Input],
) -> tuple[Part, Tables]:
    """The part `identification` with its table `residual`."""
    fit = found.fit
    part = Part(
        part="identification",
        title="Axis identification",
        reason=f"{found.method} ({why}); excitation {excitation.verdict}; no limits were given",
        inputs=inputs,
        configuration={"friction": found.friction, **found.settings},
        figures=figures(found),
        findings=[Finding(severity=Severity.WARNING, message=text) for text in excitation.reasons],
        details={
            "method": found.method,
            "why": why,
            "delay_periods": found.delay_periods,
            "excitation": asdict(excitation),
            "comparison": [asdict(row) for row in comparison],
        },
    )
    residual: Tables = {
        "residual": (
            {
                "stamp_ns": found.stamp_ns,
                "force": fit.measured,
                "predicted_force": fit.measured - fit.residual,
                "residual": fit.residual,
            },
            {"stamp_ns": "ns"}
            | dict.fromkeys(("force", "predicted_force", "residual"), found.unit),
        )
    }
    return part, residual


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
    return [
        *(_parameter(found, name, refused.get(name, "")) for name in fit.names),
        _figure("condition_number", fit.condition_number, None, ""),
        _figure("residual_norm", fit.residual_norm, None, found.unit),
        _figure("relative_error", 100 * fit.relative_error, None, "%"),
        _figure("used_share", 100 * found.motion.share, None, "%"),
    ]


def _parameter(found: Identification, name: str, refused: str) -> Figure:
    unit = unit_of(name, found.unit)
    if refused:
        return _figure(name, None, None, unit, refused)
    return _figure(name, found.fit.value(name), found.fit.deviation(name), unit)


def _figure(name: str, value: float | None, u: float | None, unit: str, reason: str = "") -> Figure:
    label = name.replace("_", " ").replace("coulomb", "Coulomb")
    label = {"used share": "share of the record used"}.get(label, label)
    return Figure(name=name, label=label, value=value, u=u, unit=unit, reason=reason)


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
