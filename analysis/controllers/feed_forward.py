"""What the axis' model needs along the reference: computed torque, shared by several laws."""

from pydantic import Field

from seamlog.analysis.friction import friction_shape
from seamlog.contracts import Axis

DeadZone = Field(0.0005, gt=0)
"""alpha of the friction shape at the reference speed, m/s; small, as that speed has no noise."""


def feed_forward(
    axis: Axis, dead_zone_m_s: float, reference_m_s: float, reference_m_s2: float
) -> float:
    """Command a a_d + b v_d + C s(v_d) with the friction of that direction, and the offset."""
    viscous, coulomb = axis.viscous_friction, axis.coulomb_friction
    if reference_m_s < 0.0:
        if axis.viscous_friction_negative is not None:
            viscous = axis.viscous_friction_negative
        if axis.coulomb_friction_negative is not None:
            coulomb = axis.coulomb_friction_negative
    friction = coulomb * friction_shape(reference_m_s, dead_zone_m_s)
    return axis.inertia * reference_m_s2 + viscous * reference_m_s + friction + axis.offset
