"""What the axis' model needs along the reference: computed torque, shared by several laws."""

from typing import NamedTuple

from pydantic import Field

from seamlog.analysis.dynamics import backward_axis
from seamlog.analysis.friction import friction_shape
from seamlog.contracts import Axis

DeadZone = Field(0.0005, gt=0)
"""alpha of the friction shape at the reference speed, m/s; small, as that speed has no noise."""


class FeedForward(NamedTuple):
    """The axis' model as `feed_forward` uses it, in the axis' command unit."""

    inertia: float
    viscous: float
    viscous_backward: float
    coulomb: float
    coulomb_backward: float
    offset: float
    dead_zone_m_s: float


NOTHING_KNOWN = FeedForward(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""The model of a law without feed-forward."""


def known_of(axis: Axis, dead_zone_m_s: float) -> FeedForward:
    """The model of `axis`."""
    backward = backward_axis(axis)
    return FeedForward(
        axis.inertia,
        axis.viscous_friction,
        backward.viscous_friction,
        axis.coulomb_friction,
        backward.coulomb_friction,
        axis.offset,
        dead_zone_m_s,
    )


def feed_forward(known: FeedForward, reference_m_s: float, reference_m_s2: float) -> float:
    """Command a a_d + b v_d + C s(v_d) with the friction of that direction, and the offset."""
    viscous, coulomb = known.viscous, known.coulomb
    if reference_m_s < 0.0:
        viscous, coulomb = known.viscous_backward, known.coulomb_backward
    friction = 0.0
    if coulomb != 0.0:
        friction = coulomb * friction_shape(reference_m_s, known.dead_zone_m_s)
    return known.inertia * reference_m_s2 + viscous * reference_m_s + friction + known.offset
