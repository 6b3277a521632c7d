"""Where the torch was along the seam, and how fast: the one place that turns stamps into s_mm.

The camera sees the torch's marker in the fixed frame; the table moves the plate under it. Against
the plate the torch is at (marker x - table x, marker y). Both are smoothed over about a second,
robustly, and s_mm is the arc length of that curve from ARC_ON.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.calibration import PlaneCalibration, parse_calibration
from seamlog.errors import EvidenceError

from .axis_record import ENCODER, FloatArray

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld

MARKER = "/robot/marker"
CALIBRATION = "calibration/table_from_camera.json"
HALF_WINDOW_S = 0.6
_FEWEST = 12
_ROUNDS = 3
_LEAST_SCATTER_MM = 0.1
"""Residuals of this size are no outliers: smoothing leaves such where the speed changes."""


@dataclass(frozen=True)
class TorchPath:
    """Arc length and speed of the torch along the seam at increasing stamps of one weld."""

    stamp_ns: NDArray[np.int64]
    s_mm: FloatArray
    speed_mm_s: FloatArray
    u_s_mm: float
    """Standard uncertainty of an arc length: scatter of the marker and scale of the camera."""
    u_speed_mm_s: float
    path_mm: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    """Places of the torch on the plate in the table frame, shape (n, 2)."""

    def at(self, stamp_ns: NDArray[np.int64]) -> FloatArray:
        """s_mm at other stamps; NaN outside the weld."""
        return _interpolated(stamp_ns, self.stamp_ns, self.s_mm)

    def speed_at(self, stamp_ns: NDArray[np.int64]) -> FloatArray:
        """Speed in mm/s at other stamps; NaN outside the weld."""
        return _interpolated(stamp_ns, self.stamp_ns, self.speed_mm_s)

    def stamp_at(self, s_mm: FloatArray) -> NDArray[np.int64]:
        """Stamps at which the torch passed `s_mm` (clamped to the weld)."""
        since = (self.stamp_ns - self.stamp_ns[0]).astype(np.float64)
        passed = np.rint(np.interp(s_mm, self.s_mm, since)).astype(np.int64)
        return np.asarray(self.stamp_ns[0] + passed, dtype=np.int64)


def torch_path(session: "Session", weld: "Weld") -> TorchPath:
    """Path of the torch during `weld`.

    Raises `EvidenceError` where the session holds no marker or no calibration of the camera.
    """
    calibration = _calibration(session)
    if MARKER not in session.info.channels:
        raise EvidenceError(
            f"{session.path} has no {MARKER}: where the torch was along the seam is not "
            "known; record the marker that the camera finds on the torch"
        )
    start_ns, end_ns = weld.start_ns, weld.end_ns
    marker = session.columns(MARKER)
    chosen = (marker["stamp_ns"] >= start_ns) & (marker["stamp_ns"] <= end_ns)
    stamp_ns, row = np.unique(marker["stamp_ns"][chosen], return_index=True)
    if len(stamp_ns) < 2 * _FEWEST:
        raise EvidenceError(
            f"only {len(stamp_ns)} torch markers lie between arc on and arc off, "
            f"{2 * _FEWEST} are needed; record the marker at 10 Hz"
        )
    pixels = np.column_stack([marker["x_px"][chosen][row], marker["y_px"][chosen][row]])
    fixed_mm = calibration.plane_mm(pixels)
    plate_mm = fixed_mm - _table_mm(session.columns(ENCODER), stamp_ns)
    return path_of(stamp_ns, plate_mm, (start_ns, end_ns), calibration.scale_relative_u)


def path_of(
    stamp_ns: NDArray[np.int64],
    plate_mm: FloatArray,
    ends_ns: tuple[int, int],
    scale_relative_u: float,
) -> TorchPath:
    """Smooth positions of shape (n, 2) against the plate and measure along them."""
    inside = (stamp_ns > ends_ns[0]) & (stamp_ns < ends_ns[1])
    grid_ns = np.concatenate([[ends_ns[0]], stamp_ns[inside], [ends_ns[1]]])
    seconds = np.asarray((stamp_ns - ends_ns[0]) * 1e-9, dtype=np.float64)
    grid_s = np.asarray((grid_ns - ends_ns[0]) * 1e-9, dtype=np.float64)
    x = _smooth(seconds, plate_mm[:, 0], grid_s)
    y = _smooth(seconds, plate_mm[:, 1], grid_s)
    chords = np.hypot(np.diff(x.value), np.diff(y.value))
    s_mm = np.concatenate([[0.0], np.cumsum(chords)])
    u_start = float(np.hypot(x.u_value, y.u_value))
    return TorchPath(
        stamp_ns=grid_ns.astype(np.int64),
        s_mm=s_mm,
        speed_mm_s=np.hypot(x.slope, y.slope),
        u_s_mm=float(np.hypot(u_start, scale_relative_u * s_mm[-1])),
        u_speed_mm_s=float(np.hypot(x.u_slope, y.u_slope)),
        path_mm=np.column_stack([x.value, y.value]),
    )


@dataclass(frozen=True)
class _Smooth:
    value: FloatArray
    slope: FloatArray
    u_value: float
    u_slope: float


def _smooth(seconds: FloatArray, values: FloatArray, grid_s: FloatArray) -> _Smooth:
    """Local quadratics with tricube weights and Tukey's against outliers."""
    distance = (seconds[None, :] - grid_s[:, None]) / _reach(seconds, grid_s)[:, None]
    near = np.clip(1 - np.abs(distance) ** 3, 0, None) ** 3
    offsets = seconds[None, :] - grid_s[:, None]
    trust = np.isfinite(values).astype(np.float64)
    clean = np.where(np.isfinite(values), values, 0.0)
    for round_ in range(_ROUNDS):
        coefficients, leverage = _local_fits(offsets, near * trust, clean)
        if round_ == _ROUNDS - 1:
            break
        fitted = np.interp(seconds, grid_s, coefficients[:, 0])
        trust = np.isfinite(values) * _tukey(clean - fitted)
    scatter = _spread((clean - np.interp(seconds, grid_s, coefficients[:, 0]))[trust > 0])
    middle = np.median(leverage, axis=0)
    return _Smooth(
        coefficients[:, 0],
        coefficients[:, 1],
        scatter * float(np.sqrt(middle[0])),
        scatter * float(np.sqrt(middle[1])),
    )


def _reach(seconds: FloatArray, grid_s: FloatArray) -> FloatArray:
    """Half window at each place: at least HALF_WINDOW_S, and wide enough to hold _FEWEST rows."""
    distance = np.sort(np.abs(seconds[None, :] - grid_s[:, None]), axis=1)
    return np.asarray(np.maximum(HALF_WINDOW_S, 1.01 * distance[:, _FEWEST - 1]))


def _local_fits(
    offsets: FloatArray, weights: FloatArray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Coefficients (grid, 3) and, per unit variance of a row, the variances of value and slope."""
    basis = np.stack([np.ones_like(offsets), offsets, offsets**2], axis=-1)
    weighed = basis * weights[..., None]
    normal = np.einsum("gni,gnj->gij", weighed, basis) + 1e-12 * np.eye(3)
    inverse = np.linalg.inv(normal)
    operator = np.einsum("gij,gnj->gin", inverse, weighed)
    return operator @ values, np.sum(operator[:, :2, :] ** 2, axis=-1)


def _tukey(residual: FloatArray) -> FloatArray:
    scale = 4.685 * max(_spread(residual), _LEAST_SCATTER_MM)
    return np.asarray(np.clip(1 - (residual / scale) ** 2, 0, None) ** 2)


def _spread(residual: FloatArray) -> float:
    return 1.4826 * float(np.median(np.abs(residual - np.median(residual))))


def _calibration(session: "Session") -> PlaneCalibration:
    if CALIBRATION not in session.attachments:
        raise EvidenceError(
            f"{session.path} has no attachment {CALIBRATION}: the marker is known in pixels "
            "only; attach the camera's plane calibration with 'seamlog attach'"
        )
    data = session.attachments[CALIBRATION].data
    found = parse_calibration(data, f"{session.path}: {CALIBRATION}")
    if not isinstance(found, PlaneCalibration):
        raise EvidenceError(f"{session.path}: {CALIBRATION} is a scale, a plane is needed")
    return found


def _table_mm(encoder: Mapping[str, NDArray[Any]], stamp_ns: NDArray[np.int64]) -> FloatArray:
    order = np.argsort(encoder["stamp_ns"], kind="stable")
    start = int(stamp_ns[0])
    x_mm = np.interp(
        (stamp_ns - start).astype(np.float64),
        (encoder["stamp_ns"][order] - start).astype(np.float64),
        1e3 * encoder["position_m"][order],
    )
    return np.column_stack([x_mm, np.zeros_like(x_mm)])


def _interpolated(
    wanted: NDArray[np.int64], stamp_ns: NDArray[np.int64], values: FloatArray
) -> FloatArray:
    start = stamp_ns[0]
    at, known = (wanted - start).astype(np.float64), (stamp_ns - start).astype(np.float64)
    found = np.interp(at, known, values)
    outside = (wanted < start) | (wanted > stamp_ns[-1])
    return np.where(outside, np.nan, found)
