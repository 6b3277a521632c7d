"""Whether the motion can tell the parameters at all: a verdict, or a refusal."""

from dataclasses import dataclass

import numpy as np

from seamlog.errors import EvidenceError

from .friction_models import is_physical
from .method import Identification, Motion

SLOWEST_M_S = 0.001
"""Slower than this counts as standing."""
FEWEST_SHARE = 0.02
"""Least share of the motion that must go the other way."""
WEAK_CONDITION = 30.0
"""Condition number of the scaled regressor above which the verdict is weak."""
UNKNOWN_DEVIATION = 0.5
"""Relative standard deviation of inertia or friction above which no value is stated."""
WEAK_DEVIATION = 0.1
"""Relative standard deviation of inertia or friction above which the verdict is weak."""


@dataclass(frozen=True)
class Excitation:
    """Verdict `sufficient` or `weak`, the reasons for it and the figures behind it."""

    verdict: str
    reasons: tuple[str, ...]
    forward_share: float
    speed_max_mm_s: float
    acceleration_rms_mm_s2: float
    used_share: float
    scaled_condition_number: float


def require_both_directions(motion: Motion) -> None:
    """Refuse a record that stands still or moves one way (`EvidenceError`).

    One way, Coulomb friction and offset enter each row with the same sign: any split of their sum
    would be invented.
    """
    moving = motion.velocity_m_s[np.abs(motion.velocity_m_s) > SLOWEST_M_S]
    if not len(moving):
        raise EvidenceError(
            f"the axis never moves faster than {1e3 * SLOWEST_M_S:g} mm/s: inertia and friction "
            "cannot be told; record a run that moves to and fro, such as 100 sin(t) mm for 20 s"
        )
    forward = float((moving > 0).mean())
    if min(forward, 1 - forward) < FEWEST_SHARE:
        direction = "positive" if forward > 0.5 else "negative"
        raise EvidenceError(
            f"the axis moves one way only ({100 * max(forward, 1 - forward):.1f} % {direction}): "
            "Coulomb friction and offset cannot be separated; record a run that moves to and fro"
        )


def judge_excitation(found: Identification) -> Excitation:
    """Verdict on an identification that was not refused."""
    motion, fit = found.motion, found.fit
    moving = motion.velocity_m_s[np.abs(motion.velocity_m_s) > SLOWEST_M_S]
    reasons = list(_vague(found))
    if fit.scaled_condition_number > WEAK_CONDITION:
        reasons.append(
            f"condition number {fit.scaled_condition_number:.3g} of the scaled regressor is above "
            f"{WEAK_CONDITION:g}: vary speed and acceleration more"
        )
    return Excitation(
        verdict="weak" if reasons else "sufficient",
        reasons=tuple(reasons),
        forward_share=float((moving > 0).mean()),
        speed_max_mm_s=1e3 * float(np.max(np.abs(motion.velocity_m_s))),
        acceleration_rms_mm_s2=1e3 * float(np.sqrt(np.mean(motion.acceleration_m_s2**2))),
        used_share=motion.share,
        scaled_condition_number=fit.scaled_condition_number,
    )


def refused_values(found: Identification) -> dict[str, str]:
    """Parameters that the record does not tell, although a number came out, each with the reason.

    Inertia and friction at or below 0, or known no better than UNKNOWN_DEVIATION.
    """
    refused = {}
    for name, value, sd in _physical(found):
        told = f"{value:.4g} +- {sd:.2g}"
        if value <= 0:
            refused[name] = f"came out as {told}, which no axis has: the record does not tell it"
        elif sd > UNKNOWN_DEVIATION * value:
            refused[name] = f"came out as {told}: the record does not tell it"
    return refused


def _vague(found: Identification) -> list[str]:
    refused = refused_values(found)
    reasons = [f"{name.replace('_', ' ')} {reason}" for name, reason in refused.items()]
    for name, value, sd in _physical(found):
        if name not in refused and sd > WEAK_DEVIATION * value:
            reasons.append(f"{name.replace('_', ' ')} is known to {100 * sd / value:.0f} % only")
    return reasons


def _physical(found: Identification) -> list[tuple[str, float, float]]:
    fit = found.fit
    rows = zip(fit.names, fit.values.tolist(), fit.sd.tolist(), strict=True)
    return [row for row in rows if is_physical(row[0])]
