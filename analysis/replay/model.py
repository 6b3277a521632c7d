"""The identified axis as a plant: in the command's unit, with all that is known of its doubt."""

from dataclasses import dataclass, replace

import numpy as np

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.analysis.coulomb_plant import CoulombPlant
from seamlog.analysis.identification.excitation import refused_values
from seamlog.analysis.identification.gated import USUAL_DELAY
from seamlog.analysis.identification.identify import identify_axis
from seamlog.analysis.live_controller import LiveController
from seamlog.analysis.plant import Plant
from seamlog.analysis.stribeck_plant import StribeckPlant
from seamlog.contracts import Axis
from seamlog.errors import EvidenceError

from .explanation import Explanation, explain
from .stribeck import with_stribeck
from .windows import Windows, motion_windows

_SUBSTEP_S = 0.005
_NAMES = ("inertia", "viscous_friction", "coulomb_friction", "offset")
_LEAST_SHARE = 1e-3
_HALF_WINDOWS_S = (0.02, 0.08, 0.12, 0.16)
_DELAYS = (0, 1, 2, 3)
_DECISIVE = 3.0
"""A delay is told by the motion if it leaves over that much less than any other."""
_SLOWEST_SHARE = 0.01
LARGEST_HIDDEN_EXCESS = 0.4
"""Static friction beyond C, as a share of it, that an axis may have without the record telling."""
_LARGEST_NOISE_SHARE = 0.02
"""Left-over squares beyond which acceleration by positions would bias the inertia."""


@dataclass(frozen=True)
class RippleForce:
    """Force that repeats with the screw, in the command's unit, opposing a positive command.

    sine sin(2 pi x / pitch) + cosine cos(2 pi x / pitch); both 0: none.
    """

    sine: float = 0.0
    cosine: float = 0.0
    pitch_m: float = 1.0


@dataclass(frozen=True)
class AxisModel:
    """The axis and what is known of it beyond a friction law.

    `explanations` (best first) stem from `windows` of finely resolved positions; without them
    `covariance` (4, 4) is of inertia, viscous friction, Coulomb friction and offset.
    """

    axis: Axis
    covariance: FloatArray
    method: str
    ripple: RippleForce = RippleForce()
    windows: Windows | None = None
    explanations: tuple[Explanation, ...] = ()
    delay_from: str = ""
    """Who says how many periods the command takes to act."""

    @property
    def hides_static_friction(self) -> bool:
        """Whether no window is slow enough to show static friction."""
        laws = [found.shape.stribeck_speed_m_s for found in self.explanations]
        return bool(laws) and not any(laws)

    def drawn(self, random: np.random.Generator) -> tuple[Axis, RippleForce]:
        """One axis from the parameters' distribution; nothing physical falls below 0."""
        if not self.explanations:
            mean = np.array([getattr(self.axis, name) for name in _NAMES])
            values = random.multivariate_normal(mean, self.covariance, method="svd")
            return _with_values(self.axis, values), self.ripple
        weights = np.array([found.weight for found in self.explanations])
        found = self.explanations[random.choice(len(weights), p=weights / weights.sum())]
        values = random.multivariate_normal(found.values, found.covariance, method="svd")
        axis, ripple = _explained(self.axis, replace(found, values=values))
        if found.shape.stribeck_speed_m_s or self.windows is None:
            return axis, ripple
        return _with_hidden_stribeck(axis, self.windows, random), ripple


def _with_hidden_stribeck(axis: Axis, windows: Windows, random: np.random.Generator) -> Axis:
    """`axis` with Stribeck friction that would show only below the slowest windows."""
    slowest_m_s = float(np.quantile(np.abs(windows.velocity_m_s), _SLOWEST_SHARE))
    excess = axis.coulomb_friction * random.uniform(0.0, LARGEST_HIDDEN_EXCESS)
    return replace(
        axis,
        static_friction=axis.coulomb_friction + excess,
        stribeck_speed_m_s=slowest_m_s * random.uniform(0.2, 0.5),
    )


def _with_values(axis: Axis, values: FloatArray) -> Axis:
    least = [_LEAST_SHARE * getattr(axis, name) for name in _NAMES[:3]]
    values = np.concatenate([np.maximum(values[:3], least), values[3:]])
    excess = max(0.0, axis.static_friction - axis.coulomb_friction)
    return replace(
        axis,
        **dict(zip(_NAMES, values.tolist(), strict=True)),
        static_friction=float(values[2]) + excess if excess else 0.0,
    )


def _explained(axis: Axis, found: Explanation) -> tuple[Axis, RippleForce]:
    """`axis` with the values of `found`."""
    axis = replace(axis, static_friction=0.0, stribeck_speed_m_s=0.0)
    axis = _with_values(axis, found.values[: len(_NAMES)])
    excess, speed_m_s = found.value("excess"), found.value("stribeck_speed_m_s")
    if excess > 0 and speed_m_s > 0:
        axis = replace(
            axis,
            static_friction=axis.coulomb_friction + excess,
            stribeck_speed_m_s=speed_m_s,
            stribeck_power=found.shape.stribeck_power,
        )
    pitch_m = found.value("pitch_m")
    if not pitch_m:
        return axis, RippleForce()
    return axis, RippleForce(found.value("ripple_sine"), found.value("ripple_cosine"), pitch_m)


def replay_plant(axis: Axis, period_s: float) -> Plant:
    """The plant of `axis`; Stribeck friction in sub-steps of about 5 ms."""
    if axis.static_friction <= axis.coulomb_friction or axis.stribeck_speed_m_s <= 0:
        return CoulombPlant(axis, period_s)
    return StribeckPlant(axis, period_s, substeps=max(1, round(period_s / _SUBSTEP_S)))


def identify_model(record: AxisRecord, live: LiveController | None) -> AxisModel:
    """Identify `record` and take delay and saturation from the live loop where it told them."""
    delay, delay_from = _delay(record, live)
    found, _ = identify_axis(record, delay_periods=delay)
    scale = record.drive.scale
    values = found.fit.values / scale
    refused = refused_values(found)
    if refused:
        told = "; ".join(f"{name} {reason}" for name, reason in refused.items())
        raise EvidenceError(f"there is no model to replay on: {told}")
    axis = Axis(
        **dict(zip(_NAMES, values.tolist(), strict=True)),
        saturation=live.axis.saturation if live else _seen_saturation(record),
        delay_periods=found.delay_periods,
        unit=record.drive.unit or "command unit",
    )
    covariance = found.fit.covariance / scale**2
    finer = _finer_model(record, axis, covariance)
    model = finer or AxisModel(with_stribeck(record, axis), covariance, found.method)
    return replace(model, delay_from=delay_from)


def _delay(record: AxisRecord, live: LiveController | None) -> tuple[int, str]:
    """Periods between a command and its effect, and who says so.

    Where the session does not, the delay that explains the motion far better than the others.
    """
    if live is not None:
        return live.axis.delay_periods, "the session"
    half = max(1, round(_HALF_WINDOWS_S[0] / record.period_s))
    shares = {}
    for delay in _DELAYS:
        windows = motion_windows(record, delay, 0.0, half)
        found = explain(windows, len(record), record.period_s)
        shares[delay] = found[0].noise_share if found else float("inf")
    best, second = sorted(shares, key=lambda delay: shares[delay])[:2]
    if shares[best] * _DECISIVE < shares[second]:
        return best, "the motion itself"
    return USUAL_DELAY, "assumption"


def _finer_model(record: AxisRecord, axis: Axis, covariance: FloatArray) -> AxisModel | None:
    """The model from the shortest windows of positions that resolve the acceleration, if any."""
    lag_1_s = axis.viscous_friction / axis.inertia
    for half in dict.fromkeys(max(1, round(s / record.period_s)) for s in _HALF_WINDOWS_S):
        windows = motion_windows(record, axis.delay_periods, lag_1_s, half)
        found = explain(windows, len(record), record.period_s)
        if not found or found[0].noise_share > _LARGEST_NOISE_SHARE:
            continue
        if np.all(found[0].values[:3] > 0):
            told, ripple = _explained(axis, found[0])
            method = "force balance over windows of positions"
            return AxisModel(told, covariance, method, ripple, windows, tuple(found))
    return None


def _seen_saturation(record: AxisRecord) -> float:
    limited = np.abs(record.command[record.saturated])
    return float(limited.max()) if len(limited) else float("inf")
