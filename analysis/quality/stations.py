"""The width at every station against limits: the station that decides, and where it is."""

import numpy as np

from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.results import Criterion, Place, Verdict

from .judge import judge

STATION = "width_mm"
"""The limit that every station of the bead has to keep."""


def station_criterion(m: BeadMeasurement, lower: float | None, upper: float | None) -> Criterion:
    """The station nearest to a limit, or furthest beyond it, in its own uncertainty."""
    label = "Width at every station"
    if m.unit != "mm" or not m.good.any() or not m.trusted:
        reason = "no calibration" if m.unit != "mm" else "no station could be measured"
        reason = doubt(m) if m.unit == "mm" and m.good.any() else reason
        return Criterion(
            name=STATION, label=label, value=None, unit="mm", lower=lower, upper=upper,
            verdict=Verdict.NOT_MEASURABLE, reason=reason,
        )  # fmt: skip
    good = np.flatnonzero(m.good)
    low = -np.inf if lower is None else lower
    high = np.inf if upper is None else upper
    room = np.minimum(m.width[good] - low, high - m.width[good])
    judged = [judge(float(m.width[at]), float(m.u_width[at]), lower, upper, "mm") for at in good]
    order = (Verdict.FAIL, Verdict.NOT_MEASURABLE, Verdict.PASS)
    verdict = next(each for each in order if any(found is each for found, _ in judged))
    chosen = [k for k, (found, _) in enumerate(judged) if found is verdict]
    at = min(chosen, key=lambda k: room[k])
    where = int(good[at])
    return Criterion(
        name=STATION, label=label, value=float(m.width[where]), unit="mm",
        u=float(m.u_width[where]), lower=lower, upper=upper, verdict=verdict,
        reason=judged[at][1], place=Place(s_mm=float(m.s[where])),
    )  # fmt: skip


def doubt(m: BeadMeasurement) -> str:
    """Why a doubtful measurement is not judged."""
    return f"confidence {m.confidence:.2f} is too low to judge"
