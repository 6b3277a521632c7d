"""Counterfactual replay: another controller in closed loop with what is known of the axis.

The axis is the identified one, its command delay included; it is disturbed by the slow residual
of the record and measured with the recorded noise. An ensemble over the parameters' covariance,
resampled residuals and fresh noise says how sure the prediction is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.analysis.closed_loop import ClosedLoop, simulate
from seamlog.contracts import Axis, Controller

from .abduction import reference_of, smooth_speed
from .disturbance import residual_disturbance
from .model import AxisModel, replay_plant
from .sliding import position_step_m

BAND = (0.05, 0.95)
_SAVGOL_LEVERAGE = 17 / 35
"""Weight of the middle sample in a local quadratic over five samples."""


@dataclass(frozen=True)
class Scene:
    """Everything of a record that a counterfactual keeps."""

    record: AxisRecord
    model: AxisModel
    position_step_m: float
    velocity_noise_m_s: float


@dataclass(frozen=True)
class Prediction:
    """Predicted run with the band of its ensemble.

    `error_m` is reference - position of the central run; `members_m` has shape (members, n).
    """

    run: ClosedLoop
    error_m: FloatArray
    members_m: FloatArray

    def band_m(self) -> tuple[FloatArray, FloatArray]:
        """5 % and 95 % of ensemble and central run at each sample."""
        low, high = np.quantile(np.vstack([self.error_m, self.members_m]), BAND, axis=0)
        return low, high

    def figure(
        self, judge: Callable[[FloatArray], float], rows: NDArray[np.bool_]
    ) -> tuple[float, float]:
        """`judge` of the central error over `rows`, with its spread over the ensemble."""
        spread = np.std([judge(member[rows]) for member in self.members_m], ddof=1)
        return judge(self.error_m[rows]), float(spread)


def make_scene(record: AxisRecord, model: AxisModel) -> Scene:
    """Take the measurement's own noise from the record."""
    rough = record.velocity_m_s - smooth_speed(record.velocity_m_s)
    return Scene(
        record,
        model,
        position_step_m=position_step_m(record),
        velocity_noise_m_s=float(np.std(rough)) / float(np.sqrt(1 - _SAVGOL_LEVERAGE)),
    )


def predict(make: Callable[[], Controller], scene: Scene, members: int, seed: int) -> Prediction:
    """Run fresh controllers in the scene: once as identified, `members` times varied."""
    model, record = scene.model, scene.record
    noise = record.velocity_m_s - smooth_speed(record.velocity_m_s)
    noise *= 1 / float(np.sqrt(1 - _SAVGOL_LEVERAGE))
    central = _run(make(), scene, model.axis, residual_disturbance(record, model.axis).slow, noise)
    random = np.random.default_rng(seed)
    errors = [_member(make(), scene, random) for _ in range(members)]
    return Prediction(central, _error(central, record), np.array(errors))


def _member(controller: Controller, scene: Scene, random: np.random.Generator) -> FloatArray:
    axis = scene.model.drawn(random)
    disturbance = residual_disturbance(scene.record, axis).resampled(random)
    noise = random.normal(0.0, scene.velocity_noise_m_s, len(scene.record))
    return _error(_run(controller, scene, axis, disturbance, noise), scene.record)


def _run(
    controller: Controller, scene: Scene, axis: Axis, disturbance: FloatArray, noise: FloatArray
) -> ClosedLoop:
    record = scene.record
    return simulate(
        controller,
        axis,
        reference_of(record),
        record.period_s,
        plant=replay_plant(axis, record.period_s),
        velocity_noise_m_s=noise,
        disturbance=disturbance,
        encoder_step_m=scene.position_step_m,
        initial_position_m=float(record.position_m[0]),
        initial_velocity_m_s=float(record.velocity_m_s[0]),
    )


def _error(run: ClosedLoop, record: AxisRecord) -> FloatArray:
    return np.asarray(record.reference_m - run.position_m)
