"""The bead: its photo with the measured toes, width along the weld, and how width is spread."""

from collections.abc import Sequence

import numpy as np

from seamlog.reports.content import AnyBlock
from seamlog.reports.curves import Column, Histogram, Limit, Plot, Series
from seamlog.reports.numbers import format_quantity
from seamlog.reports.parts import criteria, each_part, figures, findings, pictures, plots, tables
from seamlog.reports.pictures import picture_block, toe_track
from seamlog.reports.plots import make_plot, split_unit
from seamlog.reports.run import Run
from seamlog.reports.verdicts import statement
from seamlog.results import Part

_STATIONS = "stations"
_OVERLAY = "overlay"
_WIDTHS = ("width_mm", "width_px")
_MOST_BINS = 40


def section(runs: Sequence[Run]) -> list[AnyBlock]:
    """Photo and width, tied by the cursor; histogram; figures and limits."""
    return each_part(runs, "bead", _blocks)


def _blocks(run: Run, part: Part) -> list[AnyBlock]:
    return [
        *_photo(run, part),
        *_width(run, part),
        statement(part),
        *criteria(run, part),
        *findings(run, part),
        *figures(part),
        *plots(run, part, leave_out=(_STATIONS,)),
        *tables(run, part),
        *pictures(run, part, leave_out=(_OVERLAY,)),
    ]


def _photo(run: Run, part: Part) -> list[AnyBlock]:
    if _OVERLAY not in part.pictures:
        return []
    track = toe_track(run, part, part.pictures[_OVERLAY])
    return [picture_block(run, part, _OVERLAY, track)]


def _width(run: Run, part: Part) -> list[AnyBlock]:
    """Width along the bead with its band of U and the limits, and its histogram."""
    names = part.tables[_STATIONS].columns if _STATIONS in part.tables else {}
    name = next((name for name in _WIDTHS if name in names), None)
    if name is None:
        return []
    plot = make_plot(
        run, part, _STATIONS, [name], title="Bead width along the weld", limits=_limits(part, name)
    )
    update = {"series": _apart(run, part, plot.series[0]), "tolerance": _tolerance(part, name)}
    plot = plot.model_copy(update=update)
    return [plot, *_histogram(plot)]


def _apart(run: Run, part: Part, width: Series) -> list[Series]:
    """Stations that the measurement flagged as a series of their own, not to be trusted."""
    flags = run.columns(part, _STATIONS).get("flagged")
    if flags is None or flags.dtype != np.bool_ or flags.size != width.values.values.size:
        return [width]
    if not flags.any():
        return [width]
    trusted = {
        name: Column(values=np.where(flags, np.nan, column.values))
        for name in ("values", "low", "high")
        if (column := getattr(width, name)) is not None
    }
    doubtful = Column(values=np.where(flags, width.values.values, np.nan))
    flagged = Series(label="flagged, not judged", unit=width.unit, values=doubtful)
    return [width.model_copy(update=trusted), flagged]


def _limits(part: Part, name: str) -> list[Limit]:
    """Limits on the width itself (not on its spread), once each."""
    stem = name.rsplit("_", 1)[0]
    found: dict[float, Limit] = {}
    for criterion in part.criteria:
        if criterion.unit != split_unit(name)[1] or criterion.name not in _on_value(stem, name):
            continue
        for word, value in (("lower", criterion.lower), ("upper", criterion.upper)):
            if value is not None:
                text = format_quantity(value, unit=criterion.unit)
                found[value] = Limit(label=f"{word} limit {text}", value=value)
    return list(found.values())


def _tolerance(part: Part, name: str) -> tuple[float, float] | None:
    """The tightest pair of limits on the width itself."""
    known = [
        limit for limit in part.criteria if limit.name in _on_value(name.rsplit("_", 1)[0], name)
    ]
    lower = [limit.lower for limit in known if limit.lower is not None]
    upper = [limit.upper for limit in known if limit.upper is not None]
    return (max(lower), min(upper)) if lower and upper and max(lower) < min(upper) else None


def _on_value(stem: str, name: str) -> tuple[str, ...]:
    unit = name.removeprefix(f"{stem}_")
    return (name, stem, *(f"{stem}_{kind}_{unit}" for kind in ("mean", "min", "max", "station")))


def _histogram(plot: Plot) -> list[AnyBlock]:
    series = plot.series[0]
    known = series.values.values[np.isfinite(series.values.values)]
    if known.size < 2 or np.ptp(known) == 0:
        return []
    bins = int(min(max(len(np.histogram_bin_edges(known, "fd")) - 1, 8), _MOST_BINS))
    counts, edges = np.histogram(known, bins)
    return [
        Histogram(
            id=f"{plot.id}-histogram",
            title="How the width is spread",
            x_label=series.label,
            unit=series.unit,
            edges=[float(edge) for edge in edges],
            counts=[int(count) for count in counts],
            limits=plot.limits,
        )
    ]
