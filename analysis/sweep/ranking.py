"""Which tuning is best, and whether the prediction can tell it from the next ones.

All points were predicted in the same worlds, so they are compared world by world: what makes a
world hard for one makes it hard for the other, and falls out of the difference.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seamlog.analysis.axis_record import FloatArray
from seamlog.analysis.replay.counterfactual import BAND

from .evaluate import SessionFigures
from .plan import Point
from .settings import Kind

FINEST_SHARE = 0.01
"""Smaller relative differences are never told apart: the median miss of predictions of other
controllers on the counterfactual benchmark is as large."""
_NINETY = 1.645
"""Half width of a 90 % band in standard deviations."""


@dataclass(frozen=True)
class Ranked:
    """One point: figure, its standard uncertainty and 90 % band, mm; NaN if a loop ran away.

    `u_mm` contains the model's miss of the recorded run. `behind_mm` and `u_behind_mm` are the
    distance to the best; `told_apart` says whether that is more than the model's miss (at least
    FINEST_SHARE) in 95 % of the worlds.
    """

    point: Point
    by_session_mm: tuple[float, ...]
    value_mm: float
    u_mm: float
    low_mm: float
    high_mm: float
    behind_mm: float
    u_behind_mm: float
    told_apart: bool
    warnings: tuple[str, ...]


def rank(points: Sequence[Point], sessions: Sequence[SessionFigures], kind: Kind) -> list[Ranked]:
    """Points from best to worst; several sessions count alike, by the mean of their figures."""
    members = {
        point.key: np.mean([found.judged[point.key].of(kind) for found in sessions], axis=0)
        for point in points
    }
    value = {key: float(np.median(values)) for key, values in members.items()}
    order = sorted(points, key=lambda point: (np.isnan(value[point.key]), value[point.key]))
    best = members[order[0].key]
    miss = max((found.miss[kind] for found in sessions if found.miss), default=0.0)
    return [_ranked(point, sessions, kind, (members[point.key], best, miss)) for point in order]


def _ranked(
    point: Point,
    sessions: Sequence[SessionFigures],
    kind: Kind,
    judged: tuple[FloatArray, FloatArray, float],
) -> Ranked:
    members_mm, best_mm, miss = judged
    low, high = np.quantile(members_mm, BAND, method="weibull")
    value, behind = float(np.median(members_mm)), members_mm - best_mm
    resolution_mm = max(miss, FINEST_SHARE) * float(np.median(best_mm))
    least = float(np.quantile(behind, BAND[0], method="weibull"))
    return Ranked(
        point=point,
        by_session_mm=tuple(
            float(np.median(found.judged[point.key].of(kind))) for found in sessions
        ),
        value_mm=value,
        u_mm=float(np.hypot(np.std(members_mm, ddof=1), miss * value)),
        low_mm=value - float(np.hypot(value - low, _NINETY * miss * value)),
        high_mm=value + float(np.hypot(high - value, _NINETY * miss * value)),
        behind_mm=float(np.median(behind)),
        u_behind_mm=float(np.std(behind, ddof=1)),
        told_apart=bool(np.isnan(least) or least > resolution_mm),
        warnings=sessions[0].judged[point.key].warnings,
    )
