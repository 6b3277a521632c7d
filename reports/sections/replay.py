"""The recorded run against what other controllers would have done on the same weld."""

from collections.abc import Sequence

import numpy as np

from seamlog.reports.content import AnyBlock, Table
from seamlog.reports.parts import criteria, each_part, figures, findings, pictures, plots, tables
from seamlog.reports.plots import make_plot
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Figure, Part

_ERROR = "error_mm"
_COMMANDS = ("command", "shadow_command")
_RMS, _PEAK = "_rms_error_mm", "_peak_error_mm"


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Tracking errors laid over each other with their bands, then the figures."""
    return each_part(runs, "replay", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    together = _comparable(run, part)
    table, named = _comparison(part)
    return [
        statement(part),
        *table,
        *_errors(run, part, together),
        *_commands(run, part, together),
        *findings(run, part),
        *figures(part, leave_out=named),
        *criteria(run, part),
        *plots(run, part, leave_out=together),
        *tables(run, part),
        *pictures(run, part),
    ]


def _comparable(run: Run, part: Part) -> list[str]:
    """Tables with an error or a command over one and the same time; the record comes first."""
    names = [
        name
        for name, table in part.tables.items()
        if "stamp_ns" in table.columns and {_ERROR, *_COMMANDS} & set(table.columns)
    ]
    stamps = {name: run.columns(part, name)["stamp_ns"] for name in names}
    same = [name for name in names if np.array_equal(stamps[name], stamps[names[0]])]
    return sorted(same, key=lambda name: name != "recorded")


def _comparison(part: Part) -> tuple[list[AnyBlock], list[str]]:
    """Rms and peak error, one row per run, and the names of the figures in it."""
    rows: dict[str, list[Figure | None]] = {}
    for figure in part.figures:
        for place, ending in enumerate((_RMS, _PEAK)):
            if figure.name.endswith(ending):
                rows.setdefault(figure.name.removesuffix(ending), [None, None])[place] = figure
    if not rows:
        return [], []
    caption = "Tracking error, recorded and replayed (± U, k = 2)"
    named = [(_spoken(name), cells) for name, cells in rows.items()]
    table = Table(caption=caption, header=["Controller", "rms", "peak"], rows=named)
    return [table], [figure.name for row in rows.values() for figure in row if figure]


def _errors(run: Run, part: Part, tables: Sequence[str]) -> list[AnyBlock]:
    chosen = [(name, _ERROR) for name in tables if _ERROR in part.tables[name].columns]
    caption = "Shaded: where a replayed error lies with the model's uncertainty."
    return _overlaid(run, part, chosen, "Tracking error, recorded and replayed", caption)


def _commands(run: Run, part: Part, tables: Sequence[str]) -> list[AnyBlock]:
    chosen = [
        (name, column)
        for name in tables
        for column in _COMMANDS
        if column in part.tables[name].columns
    ]
    caption = "Shadow: what a controller says to the recorded measurements."
    return _overlaid(run, part, chosen, "Command, recorded and replayed", caption)


def _overlaid(
    run: Run, part: Part, chosen: Sequence[tuple[str, str]], title: str, caption: str
) -> list[AnyBlock]:
    """One plot of a column of each table."""
    if not chosen:
        return []
    drawn = [make_plot(run, part, name, [column]) for name, column in chosen]
    series = [
        plot.series[0].model_copy(
            update={"label": _spoken(name) + (", shadow" if column.startswith("shadow") else "")}
        )
        for (name, column), plot in zip(chosen, drawn, strict=True)
    ]
    update = {"title": title, "caption": caption, "series": series}
    return [drawn[0].model_copy(update=update)]


def _spoken(name: str) -> str:
    return name.replace("_", " ")
