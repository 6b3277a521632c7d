"""What the control loop saw and did, one row per command, in the order of log time.

The one place where encoder, reference and command messages are brought onto the control grid:
a command belongs to the newest encoder and reference message that had arrived by its log time. An
encoder message counts once: where none came since the last command, position and velocity are NaN.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ConfigError, EvidenceError, SessionError

if TYPE_CHECKING:
    from seamlog.session import Session

FloatArray = NDArray[np.float64]
ENCODER, REFERENCE, COMMAND = "/table/encoder", "/table/reference", "/table/command"


@dataclass(frozen=True)
class Drive:
    """What a command is: its unit, and the force it stands for where somebody said so."""

    unit: str = ""
    force_per_unit: float | None = None
    force_unit: str = ""

    @property
    def scale(self) -> float:
        """Multiply a command by this to have it in `result_unit`."""
        return 1.0 if self.force_per_unit is None else self.force_per_unit

    @property
    def result_unit(self) -> str:
        """Force unit where the force is known, else the command's own unit."""
        if self.force_per_unit is None:
            return self.unit or "command"
        return self.force_unit or "N"


@dataclass(frozen=True)
class AxisRecord:
    """Columns of one length, one row per command; what was not recorded is NaN.

    `stamp_ns` is when the position was taken (int64), `log_time_ns` when the command was logged.
    """

    stamp_ns: NDArray[np.int64]
    log_time_ns: NDArray[np.int64]
    position_m: FloatArray
    velocity_m_s: FloatArray
    reference_m: FloatArray
    reference_m_s: FloatArray
    reference_m_s2: FloatArray
    command: FloatArray
    saturated: NDArray[np.bool_]
    drive: Drive
    period_s: float

    def __len__(self) -> int:
        return len(self.stamp_ns)

    @property
    def has_velocity(self) -> bool:
        """Whether velocity was recorded at all."""
        return bool(np.isfinite(self.velocity_m_s).any())

    @property
    def has_reference(self) -> bool:
        """Whether a reference position was recorded at all."""
        return bool(np.isfinite(self.reference_m).any())

    @property
    def error_m(self) -> FloatArray:
        """Tracking error: reference - measurement."""
        return np.asarray(self.reference_m - self.position_m)

    def rows(self, chosen: slice | NDArray[Any]) -> "AxisRecord":
        """The chosen rows; the period stays that of the whole record."""
        columns = {
            item.name: getattr(self, item.name)[chosen]
            for item in fields(self)
            if isinstance(getattr(self, item.name), np.ndarray)
        }
        return replace(self, **columns)

    def between(self, start_ns: int, end_ns: int) -> "AxisRecord":
        """Rows with log time in `[start_ns, end_ns)`."""
        first, last = np.searchsorted(self.log_time_ns, [start_ns, end_ns])
        return self.rows(slice(int(first), int(last)))


def load_axis_record(session: "Session") -> AxisRecord:
    """Read the control loop of `session`.

    Raises `ChannelMissing` without encoder or command, `EvidenceError` with fewer than three rows.
    """
    command = session.columns(COMMAND)
    encoder = session.columns(ENCODER)
    reference = session.columns(REFERENCE) if REFERENCE in session.info.channels else None
    times = command["log_time_ns"]
    newest = np.searchsorted(encoder["log_time_ns"], times, side="right") - 1
    known = newest >= 0
    if int(known.sum()) < 3:
        raise EvidenceError(
            f"{session.path}: {len(times)} commands and {len(encoder['log_time_ns'])} encoder "
            "messages make fewer than three control periods; record for longer"
        )
    newest, times = newest[known], times[known]
    fresh = np.diff(newest, prepend=-1) > 0
    stamp_ns = _stamps(encoder["stamp_ns"][newest], command["stamp_ns"][known], fresh)
    asked = _reference_columns(reference, times)
    return AxisRecord(
        stamp_ns=stamp_ns,
        log_time_ns=times,
        position_m=np.where(fresh, encoder["position_m"][newest], np.nan),
        velocity_m_s=np.where(fresh, encoder["velocity_m_s"][newest], np.nan),
        reference_m=asked["position_m"],
        reference_m_s=asked["velocity_m_s"],
        reference_m_s2=asked["acceleration_m_s2"],
        command=command["command"][known],
        saturated=command["saturated"][known].astype(bool),
        drive=parse_drive(session.channel_metadata(COMMAND), str(session.path)),
        period_s=_period_s(stamp_ns),
    )


def _stamps(
    encoder_ns: NDArray[np.int64], command_ns: NDArray[np.int64], fresh: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Stamps of the positions; where none came, when it would have come beside the command."""
    usual_ns = int(np.median((command_ns - encoder_ns)[fresh]))
    return np.where(fresh, encoder_ns, command_ns - usual_ns)


def _reference_columns(
    reference: Mapping[str, NDArray[Any]] | None, times: NDArray[np.int64]
) -> dict[str, FloatArray]:
    names = ("position_m", "velocity_m_s", "acceleration_m_s2")
    if reference is None or not len(reference["log_time_ns"]):
        return {name: np.full(len(times), np.nan) for name in names}
    newest = np.searchsorted(reference["log_time_ns"], times, side="right") - 1
    early = newest < 0
    return {name: np.where(early, np.nan, reference[name][np.maximum(newest, 0)]) for name in names}


def _period_s(stamp_ns: NDArray[np.int64]) -> float:
    """Mean of the ordinary steps: exact for an even grid, blind to gaps and repeats."""
    steps = np.diff(stamp_ns)
    middle = float(np.median(steps))
    if middle <= 0:
        raise SessionError(
            f"{ENCODER} and {COMMAND}: encoder stamps stand still (median step {middle:g} ns); "
            "encoder and command must be logged in each control period"
        )
    ordinary = steps[np.abs(steps - middle) <= 0.5 * middle]
    return float(ordinary.mean()) * 1e-9


def parse_drive(metadata: Mapping[str, str], where: str) -> Drive:
    """Unit and force of a command from its channel metadata; `ConfigError` if it is nonsense."""
    text = metadata.get("force_per_unit", "")
    if not text:
        return Drive(metadata.get("unit", ""))
    try:
        force = float(text)
    except ValueError:
        force = math.nan
    if not math.isfinite(force) or force == 0:
        raise ConfigError(
            f"{where}: {COMMAND} has force_per_unit {text!r} in its metadata; "
            "it must be a number other than 0"
        )
    return Drive(metadata.get("unit", ""), force, metadata.get("force_unit", "N"))
