"""Linear stability of a sampled feedback on the axis, delay included."""

import numpy as np

from seamlog.analysis.dynamics import held_motion
from seamlog.contracts import Axis


def loop_radius(axis: Axis, period_s: float, kp: float, kd: float, ki: float = 0.0) -> float:
    """Largest magnitude among the poles of u = -(kp x + kd v + ki sum(x) T); above 1: unstable.

    Dry friction is left out; it can hold an unstable loop within small motions, not cure it.
    """
    decay, travel, speed_gain, travel_gain = held_motion(axis, period_s)
    delay = axis.delay_periods
    size = 3 + delay
    loop = np.zeros((size, size))
    loop[0, :2] = 1.0, travel
    loop[1, 1] = decay
    loop[2, 0], loop[2, 2] = period_s, 1.0
    feedback = np.zeros(size)
    feedback[:3] = -(kp + ki * period_s), -kd, -ki
    acting = feedback if delay == 0 else np.eye(size)[3]
    loop[0] += travel_gain * acting
    loop[1] += speed_gain * acting
    for place in range(delay):
        loop[3 + place] = feedback if place == delay - 1 else np.eye(size)[4 + place]
    if ki == 0.0:
        loop = np.delete(np.delete(loop, 2, 0), 2, 1)
    return float(np.abs(np.linalg.eigvals(loop)).max())


def unstable_warning(radius: float, names: str, axis: Axis) -> list[str]:
    """A warning if `radius` is not below 1."""
    if radius < 1.0:
        return []
    return [
        f"{names}: the linear loop with {axis.delay_periods} of delay is unstable "
        f"(its largest pole is {radius:.4g}, the limit is 1)"
    ]
