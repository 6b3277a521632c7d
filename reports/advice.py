"""What would have helped: the cause that the join names, and what other controllers would do.

Both are read from the results: a replay predicts tracking, so it helps only where tracking was at
fault, and it counts as better only by more than its uncertainty.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from seamlog.results import Figure, Part

from .numbers import COVERAGE, figure_quantity, format_number
from .run import Run

_RMS = "_rms_error_mm"
_RECORDED = ("recorded_predicted", "recorded")
"""What the others are set beside: the same model's prediction of the recorded controller."""
_STEADIER = {
    "weld_speed": "a steady weld speed",
    "tracking_error": "a smaller tracking error",
    "command": "a steadier command",
    "current": "a steady welding current",
    "voltage": "a steady arc voltage",
}
_MOST = 3


def advice(runs: Sequence[Run]) -> list[str]:
    """Sentences, none where the results say nothing."""
    return [
        sentence
        for run in runs
        for sentence in (
            *(text for part in run.of("join") for text in _causes(part)),
            *(text for part in run.of("replay") for text in _replayed(part)),
        )
    ]


def _causes(join: Part) -> Iterator[str]:
    causes = join.details.get("causes")
    known = [cause for cause in causes if isinstance(cause, dict)] if causes else []
    for cause in known[:_MOST]:
        channel, s_mm = cause.get("channel"), cause.get("s_mm")
        if not isinstance(channel, str) or not isinstance(s_mm, int | float):
            continue
        what = _STEADIER.get(channel, f"a steady {channel.replace('_', ' ')}")
        where = f"near s = {format_number(s_mm, 1)} mm"
        yield f"{what[:1].upper()}{what[1:]} {where}{_follows(channel, cause.get('ranking'))}."


def _follows(channel: str, ranking: Any) -> str:
    """How closely the width goes with the channel there, if the join says so."""
    rows = [row for row in ranking if isinstance(row, dict)] if isinstance(ranking, list) else []
    r = next((row.get("correlation") for row in rows if row.get("channel") == channel), None)
    if not isinstance(r, int | float):
        return ""
    return f": the width there goes with it, r = {format_number(r, 2)}"


def _replayed(part: Part) -> list[str]:
    """Whether another controller would have tracked better, by more than the doubt."""
    rms = {
        figure.name.removesuffix(_RMS): figure
        for figure in part.figures
        if figure.name.endswith(_RMS) and isinstance(figure.value, int | float)
    }
    base = next((rms[name] for name in _RECORDED if name in rms), None)
    others = {name: figure for name, figure in rms.items() if name not in _RECORDED}
    if base is None or not others:
        return []
    ranked = sorted(others, key=lambda name: float(others[name].value or 0.0))
    told = _listed({name: others[name] for name in ranked[:_MOST]})
    against = f"the recorded one {figure_quantity(base)}"
    if _is_better(others[ranked[0]], base):
        return [f"Another controller, {ranked[0]}: rms tracking error {told}; {against} (replay)."]
    number = "the one" if len(others) == 1 else f"none of the {len(others)}"
    verb = "replayed tracks no better" if len(others) == 1 else "replayed tracks better"
    return [f"Not another controller: {number} {verb} (rms error {told}; {against})."]


def _listed(figures: Mapping[str, Figure]) -> str:
    return ", ".join(f"{name} {figure_quantity(figure)}" for name, figure in figures.items())


def _is_better(one: Figure, base: Figure) -> bool:
    """Smaller by more than the expanded uncertainty of the difference."""
    doubt = COVERAGE * math.hypot(one.u or 0.0, base.u or 0.0)
    assert isinstance(one.value, int | float)
    assert isinstance(base.value, int | float)
    return one.value < base.value - doubt
