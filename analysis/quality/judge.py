"""A value against limits, with its uncertainty as a guard band."""

from seamlog.results import Verdict

COVERAGE = 2.0
"""Expanded uncertainty U = 2 u."""


def judge(
    value: float | None, u: float | None, lower: float | None, upper: float | None, unit: str = ""
) -> tuple[Verdict, str]:
    """Verdict and reason by the rule of ISO 14253-1.

    PASS only if value +- U lies inside the limits, FAIL only if it lies outside; a value nearer to
    a limit than U shows neither and is NOT MEASURABLE.
    """
    if value is None:
        return Verdict.NOT_MEASURABLE, "the value could not be measured"
    guard = COVERAGE * (u or 0.0)
    room = min(
        float("inf") if lower is None else value - lower,
        float("inf") if upper is None else upper - value,
    )
    if room >= guard:
        return Verdict.PASS, ""
    if room < -guard:
        return Verdict.FAIL, ""
    shown = f"{guard:.2g} {unit}".strip()
    return Verdict.NOT_MEASURABLE, f"the limit lies within U = {shown} of the value"
