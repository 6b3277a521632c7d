"""Whether the motion can tell the parameters at all: a verdict, or a refusal."""

from dataclasses import dataclass

import numpy as np

from seamlog.errors import EvidenceError

from .method import Identification, Motion

SLOWEST_M_S = 0.001
"""Slower than this counts as standing."""
FEWEST_SHARE = 0.02
"""Least share of the motion that must go the other way."""
WEAK_CONDITION = 30.0
"""Condition number of the scaled regressor above which the verdict is weak."""
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


def _vague(found: Identification) -> list[str]:
    reasons = []
    for name, value, sd in zip(found.fit.names, found.fit.values, found.fit.sd, strict=True):
        if name == "offset":
            continue
        if value <= 0:
            reasons.append(f"{name} came out as {value:.4g}, which no axis has")
        elif sd > WEAK_DEVIATION * value:
            reasons.append(f"{name} is known to {100 * sd / value:.0f} % only")
    return reasons
