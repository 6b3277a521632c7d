"""The friction models an identification may choose from, as columns of a linear regression."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

Friction = Literal["symmetric", "asymmetric", "symmetric-stribeck", "asymmetric-stribeck"]
FRICTIONS: tuple[Friction, ...] = (
    "symmetric",
    "asymmetric",
    "symmetric-stribeck",
    "asymmetric-stribeck",
)
SYMMETRIC = ("inertia", "viscous_friction", "coulomb_friction", "offset")
ASYMMETRIC = (
    "inertia",
    "viscous_friction_positive",
    "coulomb_friction_positive",
    "viscous_friction_negative",
    "coulomb_friction_negative",
)
FAST_STRIBECK_M_S = (0.005, 0.02)
"""Speeds over which friction near rest fades, where rest itself is in the regression."""
SLOW_STRIBECK_M_S = (0.02,)
"""The same where rows slower than some 5 mm/s are left out."""


def friction_columns(
    velocity_m_s: FloatArray, friction: Friction, stribeck_m_s: tuple[float, ...] = ()
) -> list[FloatArray]:
    """Regressor columns after the one of the inertia, in the order of the parameter names."""
    direction = np.sign(velocity_m_s)
    near_rest = [np.exp(-np.abs(velocity_m_s) / speed) for speed in stribeck_m_s]
    if "stribeck" not in friction:
        near_rest = []
    if friction.startswith("symmetric"):
        faded = [direction * share for share in near_rest]
        return [velocity_m_s, direction, np.ones_like(velocity_m_s), *faded]
    forward, backward = (1 + direction) / 2, (1 - direction) / 2
    columns = [velocity_m_s * forward, forward, velocity_m_s * backward, -backward]
    for share in near_rest:
        columns += [share * forward, -share * backward]
    return columns


def names_of(friction: Friction, stribeck_m_s: tuple[float, ...] = ()) -> tuple[str, ...]:
    """Parameter names of a friction model, inertia first."""
    speeds = [f"stribeck_{1e3 * speed:g}_mm_s" for speed in stribeck_m_s]
    if "stribeck" not in friction:
        speeds = []
    if friction.startswith("symmetric"):
        return SYMMETRIC + tuple(speeds)
    sides = [f"{name}_{side}" for name in speeds for side in ("positive", "negative")]
    return ASYMMETRIC + tuple(sides)


def unit_of(name: str, unit: str) -> str:
    """Unit of a parameter when the force (or command) is in `unit`; newtons give kilograms."""
    if name.startswith("inertia"):
        return "kg" if unit == "N" else f"{unit} s^2/m"
    return f"{unit} s/m" if name.startswith("viscous") else unit


def is_physical(name: str) -> bool:
    """Whether an axis cannot have this parameter at or below 0."""
    return name.startswith(("inertia", "viscous", "coulomb"))
