"""What all identification methods share: what they are given and what they give back."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .filtering import FloatArray
from .regression import Fit

Friction = Literal["symmetric", "asymmetric"]
SYMMETRIC = ("inertia", "viscous_friction", "coulomb_friction", "offset")
ASYMMETRIC = (
    "inertia",
    "viscous_friction_positive",
    "coulomb_friction_positive",
    "viscous_friction_negative",
    "coulomb_friction_negative",
)


@dataclass(frozen=True)
class Motion:
    """The motion an identification rests on, as the method itself sees it, row by row."""

    velocity_m_s: FloatArray
    acceleration_m_s2: FloatArray
    share: float
    """Part of the record's rows that could be used, 0 to 1."""


@dataclass(frozen=True)
class Identification:
    """Axis parameters in `unit` of force or command per SI, and what they rest on."""

    method: str
    friction: Friction
    fit: Fit
    motion: Motion
    stamp_ns: NDArray[np.int64]
    """Time of each row of the fit."""
    unit: str
    delay_periods: int
    settings: dict[str, float | int | str]


def friction_columns(velocity_m_s: FloatArray, friction: Friction) -> list[FloatArray]:
    """Regressor columns after the one of the inertia, in the order of the parameter names."""
    direction = np.sign(velocity_m_s)
    if friction == "symmetric":
        return [velocity_m_s, direction, np.ones_like(velocity_m_s)]
    forward, backward = (1 + direction) / 2, (1 - direction) / 2
    return [velocity_m_s * forward, forward, velocity_m_s * backward, -backward]


def names_of(friction: Friction) -> tuple[str, ...]:
    """Parameter names of a friction model."""
    return SYMMETRIC if friction == "symmetric" else ASYMMETRIC


def unit_of(name: str, unit: str) -> str:
    """Unit of a parameter when the force (or command) is in `unit`; newtons give kilograms."""
    if name.startswith("inertia"):
        return "kg" if unit == "N" else f"{unit} s^2/m"
    return f"{unit} s/m" if name.startswith("viscous") else unit
