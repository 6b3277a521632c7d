"""What really happened: torch and table at each tick, and the bead that follows from it.

Rule of the bead's width, with the torch's speed along the seam and the tracking error:

    width_mm = 6.0 (6.0 / speed_mm_s)^0.5 + 0.6 |error_mm|

averaged over the 2 mm of the puddle; the toes lie half of it to each side of the torch's path.
"""

import json
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.clock import SIMULATED_EPOCH_NS

from . import rig
from .schedule import TICK_S, Schedule
from .seam import TrueSeam

Floats = NDArray[np.float64]

STATION_MM = 0.5
PUDDLE_MM = 2.0
_RULE = (
    "width_mm = 6.0 * (6.0 / speed_mm_s) ** 0.5 + 0.6 * abs(tracking_error_mm), both averaged "
    "along s over 2 mm; toes half of it to each side of the torch's path on the plate"
)


@dataclass(frozen=True, slots=True)
class BeadTruth:
    """The deposited bead at stations along the seam, each array of shape (n,).

    `path_x_mm`, `y_mm`: the torch's path in the table frame (x = -travel); `tracking_error_mm`:
    reference of a perfect loop minus the table's travel.
    """

    s_mm: Floats
    y_mm: Floats
    path_x_mm: Floats
    speed_mm_s: Floats
    tracking_error_mm: Floats
    width_mm: Floats
    time_s: Floats


def bead_truth(schedule: Schedule, seam: TrueSeam, travel_mm: Floats, slip_mm: Floats) -> BeadTruth:
    """The bead from the true travel of the table and slip of the plate at each tick."""
    time_s = TICK_S * np.arange(len(travel_mm))
    s_end_mm = float(seam.s_mm(schedule.y_at(schedule.arc_off_s)))
    s = np.arange(0.0, s_end_mm, STATION_MM)
    y = seam.y_at(s)
    rises = np.concatenate([[True], np.diff(np.maximum.accumulate(schedule.y_mm)) > 0])
    passed_s = np.interp(y, schedule.y_mm[rises], time_s[rises])
    speed = np.interp(passed_s, time_s, schedule.speed_mm_s) * np.hypot(1.0, seam.slope(y))
    travel = np.interp(passed_s, time_s, travel_mm)
    slip = np.interp(passed_s, time_s, slip_mm)
    error = -(seam.x_mm(y) + slip) - travel
    width = 6.0 * np.sqrt(6.0 / speed) + 0.6 * np.abs(error)
    path_x = _averaged(-travel - slip)
    return BeadTruth(s, y, path_x, speed, error, _averaged(width), passed_s)


def _averaged(values: Floats) -> Floats:
    """Mean over the puddle, shorter at the ends."""
    half = round(0.5 * PUDDLE_MM / STATION_MM)
    kernel = np.ones(2 * half + 1)
    total = np.convolve(values, kernel, mode="same")
    return np.asarray(total / np.convolve(np.ones_like(values), kernel, mode="same"))


def truth_record(
    bead: BeadTruth, schedule: Schedule, seam: TrueSeam, seed: int, faults: tuple[str, ...]
) -> dict[str, str]:
    """The metadata record `seamlog.truth`: one JSON text under `json`."""
    profile = {
        "s_mm": _rounded(bead.s_mm),
        "y_mm": _rounded(bead.y_mm),
        "path_x_mm": _rounded(bead.path_x_mm),
        "speed_mm_s": _rounded(bead.speed_mm_s),
        "tracking_error_mm": _rounded(bead.tracking_error_mm),
        "width_mm": _rounded(bead.width_mm),
        "time_ns": [stamp_ns(value) for value in bead.time_s],
    }
    plant = asdict(rig.TRUE_AXIS)
    noise = {
        "encoder_step_m": rig.ENCODER_STEP_M,
        "velocity_noise_m_s": rig.SPEED_NOISE_M_S,
        "ripple": rig.RIPPLE.amplitude,
        "ripple_pitch_m": rig.RIPPLE.pitch_m,
    }
    truth = {
        "seed": seed,
        "faults": list(faults),
        "rule": _RULE,
        "planted_cause": _planted_cause(schedule, seam),
        "plant": plant,
        "noise": noise,
        "profile": profile,
    }
    return {"json": json.dumps(truth, separators=(",", ":"))}


def _planted_cause(schedule: Schedule, seam: TrueSeam) -> dict[str, object] | None:
    if schedule.dip_s is None:
        return None
    start_s, end_s = schedule.dip_s
    ends_mm = [float(seam.s_mm(schedule.y_at(time_s))) for time_s in schedule.dip_s]
    middle_mm = float(seam.s_mm(schedule.y_at(0.5 * (start_s + end_s))))
    return {
        "channel": "weld_speed",
        "s_mm": round(middle_mm, 2),
        "s_start_mm": round(ends_mm[0], 2),
        "s_end_mm": round(ends_mm[1], 2),
        "start_ns": stamp_ns(start_s),
        "end_ns": stamp_ns(end_s),
    }


def stamp_ns(time_s: float) -> int:
    """Nanoseconds since 1970 of a time of the run, to the microsecond."""
    return SIMULATED_EPOCH_NS + round(float(time_s) * 1e6) * 1000


def _rounded(values: Floats) -> list[float]:
    return [round(float(value), 4) for value in values]
