"""Choosing the method of identification by what the record offers."""

from typing import Literal

from seamlog.analysis.axis_record import AxisRecord

from .gated import USUAL_DELAY, identify_gated
from .idim_ls import MINIMUM_RATE_HZ, identify_idim_ls
from .method import Friction, Identification

Method = Literal["auto", "gated", "idim-ls"]


def identify_axis(
    record: AxisRecord,
    method: Method = "auto",
    friction: Friction = "symmetric",
    delay_periods: int = USUAL_DELAY,
) -> tuple[Identification, str]:
    """Identify the axis; also returns why this method was taken.

    `auto`: gated below 200 Hz, where differentiating fails, IDIM-LS from 200 Hz on. Raises
    `EvidenceError` where the record cannot tell the parameters. `delay_periods` is for `gated`.
    """
    rate_hz = 1 / record.period_s
    if method == "auto":
        method = "gated" if rate_hz < MINIMUM_RATE_HZ else "idim-ls"
        side = "below" if rate_hz < MINIMUM_RATE_HZ else "not below"
        why = f"{rate_hz:.4g} Hz is {side} {MINIMUM_RATE_HZ:g} Hz"
    else:
        why = "asked for"
    if method == "gated":
        return identify_gated(record, friction, delay_periods), why
    return identify_idim_ls(record, friction), why
