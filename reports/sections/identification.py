"""What the axis is made of: inertia and friction with uncertainty, and how the estimates came."""

from collections.abc import Sequence
from typing import Any

from seamlog.reports.content import AnyBlock, Fact, FactTable, Table
from seamlog.reports.numbers import format_quantity
from seamlog.reports.parts import criteria, each_part, figures, findings, pictures, plots, tables
from seamlog.reports.plots import split_unit
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Figure, Part


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Parameters first, then the estimator's traces and the residual."""
    return each_part(runs, "identification", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    return [
        statement(part),
        *figures(part),
        *_excitation(part),
        *_comparison(part),
        *findings(run, part),
        *plots(run, part),
        *tables(run, part),
        *pictures(run, part),
        *criteria(run, part),
    ]


def _excitation(part: Part) -> list[AnyBlock]:
    """Whether the motion could tell the parameters at all, and by what it was judged."""
    found = part.details.get("excitation")
    if not isinstance(found, dict) or "verdict" not in found:
        return []
    reasons = found.get("reasons")
    told = [str(reason) for reason in reasons] if isinstance(reasons, list) else []
    facts = [Fact(label="Verdict", value="; ".join([str(found["verdict"]), *told]))]
    for key, value in found.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            label, unit = split_unit(key)
            shown = format_quantity(float(value), unit=unit)
            facts.append(Fact(label=f"{label[:1].upper()}{label[1:]}", value=shown))
    return [FactTable(caption="Excitation: could this motion tell them?", facts=facts)]


def _comparison(part: Part) -> list[AnyBlock]:
    """The identified values beside published ones, where the part was compared."""
    rows = part.details.get("comparison")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows) or not rows:
        return []
    units = {figure.name: figure.unit for figure in part.figures}
    header = ["Parameter", "identified", "published", "difference in standard deviations"]
    return [
        Table(
            caption="Identified and published values (± U, k = 2)",
            header=header,
            rows=[_row(row, units.get(str(row.get("name")), "")) for row in rows],
        )
    ]


def _row(row: dict[str, Any], unit: str) -> tuple[str, list[Figure | None]]:
    name = str(row.get("name"))
    cells: list[Figure | None] = [
        Figure(name=name, label=kind, value=row.get(kind), u=row.get(f"{kind}_sd"), unit=unit)
        for kind in ("identified", "published")
    ]
    difference = row.get("difference_sd")
    label = "difference over the joint standard deviation"
    shown = Figure(name=name, label=label, value=difference) if difference is not None else None
    return name.replace("_", " "), [*cells, shown]
