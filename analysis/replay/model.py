"""The identified axis as a plant: in the command's unit, with the covariance of its parameters."""

from dataclasses import dataclass, replace

import numpy as np

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.analysis.dynamics import CoulombPlant, Plant, StribeckPlant
from seamlog.analysis.identification.excitation import refused_values
from seamlog.analysis.identification.gated import USUAL_DELAY
from seamlog.analysis.identification.identify import identify_axis
from seamlog.analysis.live_controller import LiveController
from seamlog.contracts import Axis
from seamlog.errors import EvidenceError

from .stribeck import with_stribeck

_SUBSTEP_S = 0.005
_NAMES = ("inertia", "viscous_friction", "coulomb_friction", "offset")
_LEAST_SHARE = 1e-3


@dataclass(frozen=True)
class AxisModel:
    """`covariance` (4, 4) is of inertia, viscous friction, Coulomb friction and offset."""

    axis: Axis
    covariance: FloatArray
    method: str

    def drawn(self, random: np.random.Generator) -> Axis:
        """One axis from the parameters' distribution; nothing physical falls below 0."""
        mean = np.array([getattr(self.axis, name) for name in _NAMES])
        values = random.multivariate_normal(mean, self.covariance, method="svd")
        values[:3] = np.maximum(values[:3], _LEAST_SHARE * mean[:3])
        excess = max(0.0, self.axis.static_friction - self.axis.coulomb_friction)
        return replace(
            self.axis,
            **dict(zip(_NAMES, values.tolist(), strict=True)),
            static_friction=float(values[2]) + excess if excess else 0.0,
        )


def replay_plant(axis: Axis, period_s: float) -> Plant:
    """The plant of `axis`; Stribeck friction in sub-steps of about 5 ms."""
    if axis.static_friction <= axis.coulomb_friction or axis.stribeck_speed_m_s <= 0:
        return CoulombPlant(axis, period_s)
    return StribeckPlant(axis, period_s, substeps=max(1, round(period_s / _SUBSTEP_S)))


def identify_model(record: AxisRecord, live: LiveController | None) -> AxisModel:
    """Identify `record` and take delay and saturation from the live loop where it told them."""
    delay = live.axis.delay_periods if live else USUAL_DELAY
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
    return AxisModel(with_stribeck(record, axis), found.fit.covariance / scale**2, found.method)


def _seen_saturation(record: AxisRecord) -> float:
    limited = np.abs(record.command[record.saturated])
    return float(limited.max()) if len(limited) else float("inf")
