"""Choosing the method of identification, the friction model and the lag."""

from dataclasses import replace

from seamlog.analysis.axis_record import AxisRecord

from .friction_models import FRICTIONS, Friction
from .gated import USUAL_DELAY, GatedSettings, gated_rows, identify_gated
from .idim_iv import identify_idim_iv
from .idim_ls import (
    MINIMUM_RATE_HZ,
    IdimSettings,
    filtered_run,
    identify_idim_ls,
    idim_force,
    idim_rows,
)
from .method import Identification, Method, Rows
from .output_error import identify_output_error, with_lag
from .selection import Selection, select_model

LAGS_PERIODS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
"""Lags of the force that model selection tries on fast records."""


def identify_axis(
    record: AxisRecord,
    method: Method = "auto",
    friction: Friction = "symmetric",
    delay_periods: int = USUAL_DELAY,
    lag_periods: float = 0.0,
) -> tuple[Identification, str]:
    """Identify the axis; also returns why this method was taken.

    `auto`: gated below 200 Hz, where differentiating fails, IDIM-LS from 200 Hz on. Raises
    `EvidenceError` where the record cannot tell the parameters. `delay_periods` is for slow
    loops, `lag_periods` for fast records.
    """
    method, why = chosen_method(record, method)
    if method == "gated":
        return identify_gated(record, friction, delay_periods), why
    if method == "batch":
        bare = GatedSettings(filter_rate_1_s=1 / record.period_s)
        return identify_gated(record, friction, delay_periods, bare, "batch"), why
    settings = with_lag(IdimSettings(), lag_periods)
    if method == "idim-iv":
        return identify_idim_iv(record, friction, settings), why
    if method == "output-error":
        return identify_output_error(record, friction, settings), why
    if method == "open-loop":
        return identify_output_error(record, friction, settings, "open"), why
    return identify_idim_ls(record, friction, settings), why


def chosen_method(record: AxisRecord, method: Method) -> tuple[Method, str]:
    """The method that `auto` stands for on this record, and why."""
    if method != "auto":
        return method, "asked for"
    rate_hz = 1 / record.period_s
    if rate_hz < MINIMUM_RATE_HZ:
        return "gated", f"{rate_hz:.4g} Hz is below {MINIMUM_RATE_HZ:g} Hz"
    return "idim-ls", f"{rate_hz:.4g} Hz is not below {MINIMUM_RATE_HZ:g} Hz"


def select_axis_model(record: AxisRecord, delay_periods: int = USUAL_DELAY) -> Selection:
    """Friction model and lag by cross-validation on the record (`EvidenceError` if none can)."""
    if 1 / record.period_s < MINIMUM_RATE_HZ:

        def slow(friction: Friction, lag: float) -> Rows:
            del lag
            return gated_rows(record, friction, delay_periods)

        return select_model(slow, (0.0,))
    run = filtered_run(record, IdimSettings())
    at_no_lag = {friction: idim_rows(run, friction, IdimSettings()) for friction in FRICTIONS}

    def fast(friction: Friction, lag: float) -> Rows:
        force = idim_force(run, with_lag(IdimSettings(), lag))
        return replace(at_no_lag[friction], measured=force)

    return select_model(fast, LAGS_PERIODS)
