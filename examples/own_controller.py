"""A controller of your own: `seamlog replay weld.mcap --controller own_controller.py:Springy -o x`.

Set its values with `--set replay.controllers.Springy.rate_1_s=6`.
"""

from pydantic import BaseModel

from seamlog.contracts import Axis


class Config(BaseModel):
    """What can be set."""

    rate_1_s: float = 4.0


class Springy:
    """u = a (a_d + 2 r e' + r^2 e): a critically damped spring towards the reference."""

    Config = Config
    state_names = ("tracking_error_m",)

    def __init__(self, config: Config, axis: Axis, period_s: float) -> None:
        self.rate, self.inertia, self.error_m = config.rate_1_s, axis.inertia, 0.0

    def output(self, x_d: float, v_d: float, a_d: float, x: float, v: float) -> float:
        """Command from the reference (x_d, v_d, a_d) and the measured motion (x, v)."""
        self.error_m = x_d - x
        return self.inertia * (a_d + 2 * self.rate * (v_d - v) + self.rate**2 * self.error_m)

    def state(self) -> tuple[float, ...]:
        """What is logged after each sample."""
        return (self.error_m,)
