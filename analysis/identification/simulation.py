"""The identified axis run again: under the recorded commands, or in the drive's own loop.

One step is one period: the friction level is that of the speed at its start, the sign of the
speed and the stick are implicit, viscous friction by the trapezoidal rule.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from seamlog.analysis.axis_record import AxisRecord

from .friction_models import FloatArray
from .servo import Servo

Step = Callable[[float, float], float]
_START_ROWS = 3
_AT_REST_M_S = 1e-3


@dataclass(frozen=True)
class Side:
    """Friction of one direction: viscous, Coulomb, and what adds to it near rest by speed."""

    viscous: float
    coulomb: float
    near_rest: tuple[tuple[float, float], ...]

    def level(self, speed_m_s: float) -> float:
        """Friction force without the viscous part at `speed_m_s` >= 0."""
        total = self.coulomb
        for fading_m_s, share in self.near_rest:
            total += share * math.exp(-speed_m_s / fading_m_s)
        return total


@dataclass(frozen=True)
class AxisForces:
    """Inertia, offset and friction to each side, in the unit of the identification."""

    inertia: float
    offset: float
    forward: Side
    backward: Side


def axis_forces(
    names: Sequence[str], values: Sequence[float], stribeck_m_s: tuple[float, ...]
) -> AxisForces:
    """From the parameters of a friction model (see `friction_models.names_of`)."""
    known = dict(zip(names, values, strict=True))
    return AxisForces(
        known["inertia"],
        known.get("offset", 0.0),
        _side(known, "positive", stribeck_m_s),
        _side(known, "negative", stribeck_m_s),
    )


def _side(known: dict[str, float], side: str, stribeck_m_s: tuple[float, ...]) -> Side:
    def of(name: str) -> float:
        return known.get(name, known.get(f"{name}_{side}", 0.0))

    near = [(speed, of(f"stribeck_{1e3 * speed:g}_mm_s")) for speed in stribeck_m_s]
    return Side(of("viscous_friction"), of("coulomb_friction"), tuple(near))


def make_step(axis: AxisForces, step_s: float) -> Step:
    """Speed one step later from speed and force."""
    gain, offset = step_s / axis.inertia, axis.offset

    def moved(velocity: float, force: float, side: Side, sign: float, level: float) -> float:
        half = 0.5 * gain * side.viscous
        return (velocity * (1.0 - half) + gain * (force - sign * level)) / (1.0 + half)

    def step(velocity_m_s: float, force: float) -> float:
        force -= offset
        ahead = velocity_m_s > 0.0 or (velocity_m_s == 0.0 and force > 0.0)
        side, sign = (axis.forward, 1.0) if ahead else (axis.backward, -1.0)
        level = side.level(abs(velocity_m_s))
        if velocity_m_s == 0.0 and abs(force) <= level:
            return 0.0
        after = moved(velocity_m_s, force, side, sign, level)
        if after * sign >= 0.0:
            return after
        if abs(force) <= level:
            return 0.0
        side, sign = (axis.backward, -1.0) if ahead else (axis.forward, 1.0)
        after = moved(velocity_m_s, force, side, sign, side.level(0.0))
        return after if after * sign >= 0.0 else 0.0

    return step


def simulate_commands(record: AxisRecord, axis: AxisForces, lag_periods: float) -> FloatArray:
    """Positions under the recorded commands, from rest at the first position (open loop)."""
    force = record.command * record.drive.scale
    before = np.concatenate([force[:1], force[:-1]])
    force = (1 - lag_periods) * force + lag_periods * before
    period, step = record.period_s, make_step(axis, record.period_s)
    x, v, positions = float(record.position_m[0]), 0.0, []
    for acting in force.tolist():
        positions.append(x)
        after = step(v, acting)
        x += 0.5 * period * (v + after)
        v = after
    return np.array(positions)


@dataclass(frozen=True)
class ServoRun:
    """The loop simulated: positions, speeds and commands, each of shape (n,)."""

    position_m: FloatArray
    velocity_m_s: FloatArray
    command: FloatArray


def simulate_servo(
    record: AxisRecord, axis: AxisForces, servo: Servo, lag_periods: float
) -> ServoRun:
    """The drive's law and the axis in closed loop along the recorded reference."""
    period, step, scale = record.period_s, make_step(axis, record.period_s), record.drive.scale
    outer, inner, window = servo.position_gain_1_s, servo.velocity_gain, servo.window
    x, v = _start(record)
    passed = [x - back * period * v for back in range(window, 0, -1)]
    last = float(record.command[0])
    rows = []
    for k, wanted in enumerate(record.reference_m.tolist()):
        seen = (x - passed[k]) / (window * period)
        command = min(max(inner * (outer * (wanted - x) - seen), -servo.limit), servo.limit)
        rows.append((x, v, command))
        passed.append(x)
        after = step(v, scale * ((1 - lag_periods) * command + lag_periods * last))
        x += 0.5 * period * (v + after)
        v, last = after, command
    columns = np.array(rows).T
    return ServoRun(columns[0], columns[1], columns[2])


def _start(record: AxisRecord) -> tuple[float, float]:
    """Position and speed of the first sample; below _AT_REST_M_S it rests."""
    x = record.position_m[:_START_ROWS]
    after_s = record.period_s * np.arange(len(x))
    speed = float(np.polynomial.Polynomial.fit(after_s, x, 2).deriv()(0.0))
    return float(x[0]), speed if abs(speed) > _AT_REST_M_S else 0.0
