"""Model predictive control: the best commands over a horizon within the saturation (osqp).

The error is predicted on inertia and viscous friction; dry friction is compensated along the
reference, which goes on with its present acceleration. Needs the extra `mpc`.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from seamlog.analysis.coulomb_plant import CoulombPlant
from seamlog.analysis.dynamics import held_motion
from seamlog.contracts import Axis
from seamlog.errors import HardwareError, PluginFailed

from .feed_forward import DeadZone, feed_forward, known_of
from .sent import SentCommands

if TYPE_CHECKING:
    from numpy.typing import NDArray


class MPCConfig(BaseModel):
    """Horizon and sizes that weigh alike in the cost."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    horizon_periods: int = Field(15, ge=2, le=200)
    error_m: float = Field(0.002, gt=0)
    error_m_s: float = Field(0.05, gt=0)
    command: float | None = Field(None, gt=0)
    """Departure from the feed-forward, command unit; None: 0.2 m/s^2 times the inertia."""
    command_limit: float | None = Field(None, gt=0)
    """Largest command planned; None: the saturation of the axis."""
    dead_zone_m_s: float = DeadZone


class MPC:
    """First command of the plan that minimises predicted errors and effort."""

    Config = MPCConfig
    state_names = (
        "tracking_error_m",
        "tracking_error_m_s",
        "feed_forward_command",
        "feedback_command",
        "planned_cost",
    )

    def __init__(self, config: MPCConfig, axis: Axis, period_s: float) -> None:
        self._config, self._axis, self._period_s = config, axis, period_s
        self._model = known_of(axis, config.dead_zone_m_s)
        self._plant, self._sent = CoulombPlant(axis, period_s), SentCommands(axis)
        self._limit = min(axis.saturation, config.command_limit or axis.saturation)
        self._state = (0.0,) * 5
        free, forced = _prediction(axis, period_s, config.horizon_periods)
        weights = np.tile([config.error_m**-2, config.error_m_s**-2], config.horizon_periods)
        effort = (config.command or 0.2 * axis.inertia) ** -2
        self._slope = forced.T @ (weights[:, None] * free)
        curvature = forced.T @ (weights[:, None] * forced)
        self._solver = _solver(curvature + effort * np.eye(config.horizon_periods))

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: float,
        velocity_m_s: float,
    ) -> float:
        """Command before saturation."""
        error_m, error_m_s = reference_m - position_m, reference_m_s - velocity_m_s
        self._sent.arrive()
        for command in self._sent.due:
            position_m, velocity_m_s = self._plant.step(position_m, velocity_m_s, command)
        ahead_s = self._axis.delay_periods * self._period_s
        late_m = reference_m + ahead_s * (reference_m_s + 0.5 * ahead_s * reference_m_s2)
        late_m_s = reference_m_s + ahead_s * reference_m_s2
        known = self._known(late_m_s, reference_m_s2)
        plan, cost = self._plan(late_m - position_m, late_m_s - velocity_m_s, known)
        wanted = float(known[0]) + plan
        self._sent.send(wanted)
        self._state = (error_m, error_m_s, float(known[0]), plan, cost)
        return wanted

    def _known(self, speed_m_s: float, reference_m_s2: float) -> "NDArray[np.float64]":
        step_m_s = self._period_s * reference_m_s2
        periods = range(self._config.horizon_periods)
        return np.array(
            [feed_forward(self._model, speed_m_s + k * step_m_s, reference_m_s2) for k in periods]
        )

    def _plan(
        self, error_m: float, error_m_s: float, known: "NDArray[np.float64]"
    ) -> tuple[float, float]:
        slope = self._slope @ np.array([error_m, error_m_s])
        self._solver.update(q=slope, l=-self._limit - known, u=self._limit - known)
        found = self._solver.solve(raise_error=False)
        if found.x is None or not np.isfinite(found.x[0]):
            raise PluginFailed(f"mpc found no plan: osqp says {found.info.status!r}")
        return float(found.x[0]), float(found.info.obj_val)

    def state(self) -> tuple[float, ...]:
        """Values in the order of `state_names`."""
        return self._state

    def warnings(self) -> list[str]:
        """A horizon too short to see the axis settle."""
        horizon_s = self._config.horizon_periods * self._period_s
        if horizon_s >= 4.0 * self._period_s * (1 + self._axis.delay_periods):
            return []
        return [
            f"horizon_periods {self._config.horizon_periods} is below four times the delay and a "
            "period: plans end before their first command has had its effect"
        ]


def _prediction(
    axis: Axis, period_s: float, horizon: int
) -> tuple["NDArray[np.float64]", "NDArray[np.float64]"]:
    """Errors (e, e') over the horizon: free (2 n, 2) of the present ones, forced (2 n, n)."""
    decay, travel, speed_gain, travel_gain = held_motion(axis, period_s)
    step = np.array([[1.0, travel], [0.0, decay]])
    push = np.array([-travel_gain, -speed_gain])
    free, forced = np.zeros((2 * horizon, 2)), np.zeros((2 * horizon, horizon))
    state, reach = np.eye(2), np.zeros((2, horizon))
    for k in range(horizon):
        state, reach = step @ state, step @ reach
        reach[:, k] += push
        free[2 * k : 2 * k + 2], forced[2 * k : 2 * k + 2] = state, reach
    return free, forced


def _solver(curvature: "NDArray[np.float64]") -> Any:
    try:
        import osqp
    except ModuleNotFoundError as error:
        raise HardwareError(
            "the controller mpc needs osqp, which is not installed: pip install 'seamlog[mpc]'"
        ) from error
    from scipy import sparse

    count = len(curvature)
    solver = osqp.OSQP()
    solver.setup(
        P=sparse.triu(sparse.csc_matrix(curvature), format="csc"),
        q=np.zeros(count),
        A=sparse.eye(count, format="csc"),
        l=np.full(count, -np.inf),
        u=np.full(count, np.inf),
        verbose=False,
        eps_abs=1e-9,
        eps_rel=1e-9,
        max_iter=20_000,
        adaptive_rho_interval=25,
    )
    return solver
