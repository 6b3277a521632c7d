"""A sweep as a part of the results: the ranking as a table, the best with its runner-up."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from seamlog.analysis.part_tables import Tables
from seamlog.results import Figure, Finding, Part, Severity

from .evaluate import SessionFigures
from .ranking import Ranked
from .settings import SweepSettings

UNSTABLE = "the predicted loop runs away"


def sweep_part(
    ranked: Sequence[Ranked], sessions: Sequence[SessionFigures], settings: SweepSettings
) -> tuple[Part, Tables]:
    """The part `sweep` with its table `ranking`."""
    where = f"{len(sessions)} sessions" if len(sessions) > 1 else sessions[0].path.name
    part = Part(
        part="sweep",
        title="Sweep",
        reason=f"{len(ranked)} tunings predicted from {where}; ranks, judges none",
        inputs=[item for found in sessions for item in found.inputs],
        configuration=settings.model_dump(mode="json"),
        figures=_figures(ranked, settings.figure),
        findings=_findings(ranked, sessions),
        details={
            "best": _told(ranked[0]),
            "as_good": [_told(row) for row in ranked[1:] if not row.told_apart],
            "resumed": sum(found.resumed for found in sessions),
            "model_misses": {found.path.name: found.miss for found in sessions},
        },
    )
    return part, {"ranking": _table(ranked, sessions)}


def _figures(ranked: Sequence[Ranked], kind: str) -> list[Figure]:
    best = ranked[0]
    found = [_figure(f"best_{kind}_error_mm", f"{kind} tracking error, {name_of(best)}", best)]
    if len(ranked) > 1:
        second = ranked[1]
        label = f"{kind} tracking error, {name_of(second)}"
        found.append(_figure(f"runner_up_{kind}_error_mm", label, second))
        behind = Figure(
            name="runner_up_behind_mm",
            label="runner-up behind the best, in the same worlds",
            value=None if np.isnan(second.behind_mm) else second.behind_mm,
            u=None if np.isnan(second.behind_mm) else second.u_behind_mm,
            unit="mm",
            reason=UNSTABLE if np.isnan(second.behind_mm) else "",
        )
        found.append(behind)
    return found


def _figure(name: str, label: str, row: Ranked) -> Figure:
    if np.isnan(row.value_mm):
        return Figure(name=name, label=label, value=None, unit="mm", reason=UNSTABLE)
    return Figure(name=name, label=label, value=row.value_mm, u=row.u_mm, unit="mm")


def _findings(ranked: Sequence[Ranked], sessions: Sequence[SessionFigures]) -> list[Finding]:
    told = [(Severity.INFO, verdict_of(ranked))]
    told += [(Severity.WARNING, f"{name_of(ranked[0])}: {text}") for text in ranked[0].warnings]
    runaways = sum(bool(np.isnan(row.value_mm)) for row in ranked)
    if runaways:
        told.append((Severity.WARNING, f"{runaways} of {len(ranked)} tunings run away"))
    for found in sessions:
        told += [(Severity.INFO, f"{found.path.name}: {note}") for note in found.notes]
        if found.miss is None:
            text = "the recorded controller is not known: how well the model predicts is unchecked"
            told.append((Severity.WARNING, f"{found.path.name}: {text}"))
    return [Finding(severity=severity, message=text) for severity, text in told]


def verdict_of(ranked: Sequence[Ranked]) -> str:
    """Whether the winner is one, in words."""
    if np.isnan(ranked[0].value_mm):
        return "every tuning runs away"
    alike = sum(not row.told_apart for row in ranked[1:])
    if len(ranked) > 1 and not ranked[1].told_apart:
        return (
            f"the winner is not distinguishable from the runner-up: {alike} of {len(ranked) - 1} "
            "other tunings are as good as far as this prediction can tell"
        )
    return "the winner is better than every other tuning in 95 % of the worlds"


def name_of(row: Ranked) -> str:
    """Controller and what was varied."""
    values = ", ".join(f"{name}={_short(value)}" for name, value in row.point.varied.items())
    return f"{row.point.choice.name} ({values})" if values else row.point.choice.name


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _told(row: Ranked) -> dict[str, Any]:
    return {"controller": row.point.choice.name, "configuration": row.point.choice.config}


def _table(ranked: Sequence[Ranked], sessions: Sequence[SessionFigures]) -> Any:
    columns: dict[str, Any] = {
        "rank": np.arange(1, len(ranked) + 1),
        "controller": np.array([row.point.choice.name for row in ranked], dtype=object),
    }
    for name in dict.fromkeys(name for row in ranked for name in row.point.varied):
        columns[name] = _column([row.point.varied.get(name) for row in ranked])
    lengths = ("value_mm", "low_mm", "high_mm", "behind_mm")
    for name in lengths:
        columns[name] = np.array([getattr(row, name) for row in ranked])
    columns["sd_mm"] = np.array([row.u_mm for row in ranked])
    columns["sd_behind_mm"] = np.array([row.u_behind_mm for row in ranked])
    for place, found in enumerate(sessions if len(sessions) > 1 else ()):
        columns[f"{found.path.stem}_mm"] = np.array([row.by_session_mm[place] for row in ranked])
    columns["told_apart"] = np.array([row.told_apart for row in ranked])
    return columns, {name: "mm" for name in columns if name.endswith("_mm")}


def _column(values: list[Any]) -> Any:
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values, dtype=np.float64)
    texts = ["" if value is None else json.dumps(value) for value in values]
    return np.array(texts, dtype=object)
