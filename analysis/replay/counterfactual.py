"""Counterfactual replay: another controller in closed loop with what is known of the axis.

The axis is the identified one, its command delay included; it is disturbed by the slow residual
of the record and measured with the recorded noise. An ensemble over the parameters' covariance,
friction laws as likely as the best, resampled residuals and resampled noise says how sure the
prediction is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import AxisRecord, FloatArray
from seamlog.analysis.closed_loop import ClosedLoop
from seamlog.contracts import Axis, Controller

from .abduction import reference_of, smooth_speed
from .batch import FAR_M, Start, World, simulate_worlds
from .disturbance import Residual, residual_disturbance, window_residual
from .model import AxisModel, RippleForce
from .sliding import position_step_m

Judge = Callable[[FloatArray], float]
BAND = (0.05, 0.95)
_SAVGOL_LEVERAGE = 17 / 35
"""Weight of the middle sample in a local quadratic over five samples."""
_NOISE_BLOCK_S = 1.0
_MOST_AT_ONCE = 4000
"""Loops that are simulated side by side."""


@dataclass(frozen=True)
class Scene:
    """Everything of a record that a counterfactual keeps; noise of the speed in m/s, (n,)."""

    record: AxisRecord
    model: AxisModel
    position_step_m: float
    velocity_noise_m_s: FloatArray

    def residual(self, axis: Axis, ripple: RippleForce) -> Residual:
        """What acted beside `axis` and `ripple`."""
        if self.model.windows is None:
            return residual_disturbance(self.record, axis)
        return window_residual(self.record, self.model.windows, axis, ripple)

    def as_identified(self) -> World:
        """The best explanation of the record, with its own noise."""
        axis, ripple = self.model.axis, self.model.ripple
        return World(axis, ripple, self.residual(axis, ripple).slow, self.velocity_noise_m_s)

    def varied(self, random: np.random.Generator) -> World:
        """Another explanation about as likely, with other noise."""
        axis, ripple = self.model.drawn(random)
        disturbance = self.residual(axis, ripple).resampled(random)
        noise = self.velocity_noise_m_s
        block = max(1, round(_NOISE_BLOCK_S / self.record.period_s))
        starts = random.integers(0, max(1, len(noise) - block), size=-(-len(noise) // block))
        rows = (starts[:, None] + np.arange(block)).ravel()[: len(noise)]
        noise = noise[np.minimum(rows, len(noise) - 1)] * random.choice([-1.0, 1.0])
        return World(axis, ripple, disturbance, noise)


@dataclass(frozen=True)
class Prediction:
    """Predicted run with its ensemble.

    `error_m` is reference - position of the central run; `members_m` has shape (members, n).
    """

    run: ClosedLoop
    error_m: FloatArray
    members_m: FloatArray

    @property
    def is_bounded(self) -> bool:
        """False where the loop ran away, in the central run or in a member."""
        farthest = max(float(np.abs(self.error_m).max()), float(np.abs(self.members_m).max()))
        return farthest < 0.5 * FAR_M

    def band_m(self) -> tuple[FloatArray, FloatArray]:
        """5 % and 95 % of the ensemble at each sample; never without the central run."""
        low, high = np.quantile(self.members_m, BAND, axis=0, method="weibull")
        return np.minimum(low, self.error_m), np.maximum(high, self.error_m)

    def judged(self, judge: Judge, rows: NDArray[np.bool_]) -> FloatArray:
        """`judge` of the error over `rows` of each member, shape (members,)."""
        return np.array([judge(member[rows]) for member in self.members_m])

    def best(self, judge: Judge, rows: NDArray[np.bool_]) -> float:
        """Median over the ensemble: noise makes one run a lucky or an unlucky one."""
        return float(np.median(self.judged(judge, rows)))

    def spread(self, judge: Judge, rows: NDArray[np.bool_]) -> float:
        """Standard deviation over the ensemble."""
        return float(np.std(self.judged(judge, rows), ddof=1))

    def band(self, judge: Judge, rows: NDArray[np.bool_]) -> tuple[float, float]:
        """5 % and 95 % over the ensemble."""
        low, high = np.quantile(self.judged(judge, rows), BAND, method="weibull")
        return float(low), float(high)


def make_scene(record: AxisRecord, model: AxisModel) -> Scene:
    """Take the measurement's own noise from the record."""
    rough = record.velocity_m_s - smooth_speed(record.velocity_m_s)
    return Scene(
        record,
        model,
        position_step_m=position_step_m(record),
        velocity_noise_m_s=rough / float(np.sqrt(1 - _SAVGOL_LEVERAGE)),
    )


def predict(make: Callable[[], Controller], scene: Scene, members: int, seed: int) -> Prediction:
    """Run fresh controllers in the scene: once as identified, `members` times varied."""
    return predict_many([make], scene, members, seed)[0]


def predict_many(
    makes: Sequence[Callable[[], Controller]], scene: Scene, members: int, seed: int
) -> list[Prediction]:
    """As `predict` for several controllers, all in the same variations of the scene."""
    random = np.random.default_rng(seed)
    worlds = [scene.as_identified(), *(scene.varied(random) for _ in range(members))]
    at_once = max(1, _MOST_AT_ONCE // len(worlds))
    groups = [makes[i : i + at_once] for i in range(0, len(makes), at_once)]
    return [found for group in groups for found in _predict_group(group, scene, worlds)]


def _predict_group(
    makes: Sequence[Callable[[], Controller]], scene: Scene, worlds: list[World]
) -> list[Prediction]:
    record, each = scene.record, len(worlds)
    runs = simulate_worlds(
        [make() for make in makes for _ in worlds],
        worlds * len(makes),
        reference_of(record),
        record.period_s,
        Start(float(record.position_m[0]), float(record.velocity_m_s[0]), scene.position_step_m),
        watched=range(0, each * len(makes), each),
    )
    errors_m = record.reference_m - runs.position_m
    return [
        Prediction(runs.watched[first], errors_m[first], errors_m[first + 1 : first + each])
        for first in range(0, len(errors_m), each)
    ]
