"""The recorded run against what other controllers would have done on the same weld."""

from collections.abc import Sequence

import numpy as np

from seamlog.reports.content import AnyBlock, Series, TimePlot
from seamlog.reports.parts import criteria, each_part, figures, findings, pictures, plots
from seamlog.reports.plots import make_plot
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Part

_ERROR = "error_mm"


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Tracking errors laid over each other with their bands, then the figures."""
    return each_part(runs, "replay", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    together = _comparable(run, part)
    return [
        statement(part),
        *findings(run, part),
        *_overlaid(run, part, together),
        *figures(part),
        *criteria(run, part),
        *plots(run, part, leave_out=together),
        *pictures(run, part),
    ]


def _comparable(run: Run, part: Part) -> list[str]:
    """Tables with an error over one and the same time."""
    names = [n for n, t in part.tables.items() if {"stamp_ns", _ERROR} <= set(t.columns)]
    stamps = {name: run.columns(part, name)["stamp_ns"] for name in names}
    return [name for name in names if np.array_equal(stamps[name], stamps[names[0]])]


def _overlaid(run: Run, part: Part, tables: list[str]) -> list[AnyBlock]:
    if not tables:
        return []
    drawn = [make_plot(run, part, name, [_ERROR]) for name in tables]
    series = [_named(name, plot.series[0]) for name, plot in zip(tables, drawn, strict=True)]
    plot = drawn[0].model_copy(
        update={
            "title": "Tracking error, recorded and replayed",
            "caption": "Shaded: where a replayed error lies with the model's uncertainty.",
            "series": series,
        }
    )
    assert isinstance(plot, TimePlot)
    return [plot]


def _named(table: str, series: Series) -> Series:
    return series.model_copy(update={"label": table.replace("_", " ")})
