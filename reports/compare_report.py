"""A comparison as a report and as Markdown for a pull request."""

from collections.abc import Iterator, Sequence

from seamlog.results import Figure, Severity, Verdict

from .comparison import Change, Comparison, Judged
from .content import AnyBlock, Banner, FindingLine, Notice, Table, Text
from .curves import Column, SeamPlot, Series, TimePlot
from .numbers import figure_quantity, format_quantity
from .pairing import Paired, Shared
from .report import Report
from .run import Run, anchor

_INTERVAL = "95 % confidence interval of the mean difference"


def compare_report(
    runs: Sequence[Run], comparison: Comparison, title: str | None, date: str | None
) -> Report:
    """The page: verdict, figures side by side, paired differences, curves over each other."""
    base, *others = comparison.labels
    report = Report(
        title or f"{', '.join(others)} against {base}", date, sections=("record", "provenance")
    )
    report.runs = list(runs)
    report.judge(comparison.verdict)
    report.add_section("comparison", "Comparison", [_banner(comparison), *_unknown(comparison)])
    report.add_section("figures", "Figures side by side", list(_figure_tables(comparison)))
    report.add_section("paired", "Paired differences", list(_paired_tables(comparison)))
    curves = [_overlaid(shared, comparison.labels) for shared in comparison.shared]
    report.add_section("curves", "Curves over each other", curves or [_none("curve")])
    return report


def markdown(comparison: Comparison) -> str:
    """The comparison as Markdown; text of the results cannot break out of its cell."""
    lines = [f"**{comparison.verdict.value}**: {summary(comparison)}", ""]
    told = [f"- {_plain(text)}" for text in (*comparison.regressions, *comparison.unknown)]
    lines += [*told, ""] if told else []
    lines += [*_row("Figure", *comparison.labels), "|---" * (len(comparison.labels) + 1) + "|"]
    for change in comparison.changes:
        if change.judged:
            lines += _row(_label(change), *(_told(figure) for figure in change.figures))
    for limit in comparison.limits:
        words = [verdict.value if verdict else "–" for verdict in limit.verdicts]
        lines += _row(f"{limit.part}: limit on {limit.label}", *words)
    lines += ["", *_row("Paired difference", "run", "mean", "95 % interval"), "|---|---|---|---|"]
    for item in comparison.paired:
        name = f"{item.part}, {item.table}: {item.label}"
        lines += _row(name, item.run, _mean(item), _interval(item))
    return "\n".join(lines)


def summary(comparison: Comparison) -> str:
    """The verdict in a sentence."""
    count = len(comparison.regressions)
    if count:
        return f"{count} regression{'s' if count > 1 else ''} beyond the tolerance."
    if comparison.verdict is Verdict.NOT_ASSESSED:
        return "Nothing that could be judged is in all results."
    return "No regression beyond the tolerance."


def _banner(comparison: Comparison) -> Banner:
    reasons = [FindingLine(severity=Severity.FAULT, message=t) for t in comparison.regressions]
    return Banner(verdict=comparison.verdict, summary=summary(comparison), reasons=reasons)


def _unknown(comparison: Comparison) -> list[AnyBlock]:
    return [Notice(text=text, reason="Not counted as unchanged.") for text in comparison.unknown]


def _figure_tables(comparison: Comparison) -> Iterator[AnyBlock]:
    header = ["Figure", *comparison.labels]
    judged = [change for change in comparison.changes if change.judged]
    others = [change for change in comparison.changes if not change.judged]
    for caption, changes in (("Judged: larger is worse", judged), ("Shown, not judged", others)):
        if changes:
            rows = [(_label(change), list(change.figures)) for change in changes]
            yield Table(caption=caption, header=header, rows=rows)
    if comparison.limits:
        rows = [(f"{limit.part}: {limit.label}", _words(limit)) for limit in comparison.limits]
        yield Table(caption="Limits", header=["Limit on", *comparison.labels], rows=rows)
    if not comparison.changes:
        yield _none("figure")


def _words(limit: Judged) -> list[Figure | None]:
    return [
        Figure(name="verdict", label="verdict", value=verdict.value) if verdict else None
        for verdict in limit.verdicts
    ]


def _paired_tables(comparison: Comparison) -> Iterator[AnyBlock]:
    if not comparison.paired:
        yield _none("column")
        return
    yield Text(
        text="Each value of the first run is set beside the other's at the same place or moment. "
        "The interval counts only as many values as are independent of each other."
    )
    header = ["Difference to the first", "run", "mean", "low", "high", "pairs", "independent"]
    rows = [
        (f"{item.part}, {item.table}: {item.label}", _cells(item)) for item in comparison.paired
    ]
    yield Table(caption=_INTERVAL, header=header, rows=rows)


def _cells(item: Paired) -> list[Figure | None]:
    def cell(value: float | str | None, unit: str = "") -> Figure | None:
        return None if value is None else Figure(name="", label="", value=value, unit=unit)

    ends = [cell(value, item.unit) for value in (item.mean, item.low, item.high)]
    independent = None if item.effective is None else round(item.effective)
    return [cell(item.run), *ends, cell(item.count), cell(independent)]


def _overlaid(shared: Shared, labels: Sequence[str]) -> AnyBlock:
    """The column of every run at the places of the first."""
    base = shared.curves[0]
    assert base is not None
    series = [
        Series(label=label, unit=shared.unit, values=Column(values=curve.at(base.x)))
        for label, curve in zip(labels, shared.curves, strict=True)
        if curve is not None
    ]
    along_seam = base.by.startswith("place")
    weld = shared.part.weld or shared.part.index
    own = "photo" if shared.part.part == "bead" else "seam" if along_seam else "time"
    common = {
        "id": anchor("plot", "compare", shared.part.stem, shared.table, shared.column),
        "title": f"{shared.part.title}: {shared.column.replace('_', ' ')}",
        "x": Column(values=base.x),
        "x_label": "along the seam" if along_seam else "time since the start",
        "x_unit": "mm" if along_seam else "s",
        "y_label": f"[{shared.unit}]" if shared.unit not in ("", "1") else "",
        "series": series,
        "domain": f"compare/{own}/{weld}",
        "compact": True,
    }
    return SeamPlot(**common) if along_seam else TimePlot(**common)


def _none(what: str) -> Notice:
    return Notice(
        text="Nothing to compare", reason=f"No {what} is in more than one of the results."
    )


def _label(change: Change) -> str:
    index = f" {change.index}" if change.index > 1 else ""
    return f"{change.part}{index}: {change.base.label}"


def _told(figure: Figure | None) -> str:
    return "–" if figure is None or figure.value is None else str(figure_quantity(figure))


def _mean(item: Paired) -> str:
    return "–" if item.mean is None else format_quantity(item.mean, unit=item.unit)


def _interval(item: Paired) -> str:
    if item.low is None or item.high is None:
        return item.reason or "–"
    return f"{format_quantity(item.low)} to {format_quantity(item.high, unit=item.unit)}"


def _row(*cells: str) -> list[str]:
    return ["| " + " | ".join(_plain(cell) for cell in cells) + " |"]


def _plain(text: str) -> str:
    """Text that Markdown shows as it is, on one line."""
    flat = " ".join(text.split())
    for sign in "\\`*_[]<>|#@~":
        flat = flat.replace(sign, f"\\{sign}" if sign not in "<>@" else f"&#{ord(sign)};")
    return flat
