"""Other controllers predicted from one record, beside what they truly do.

The true axis has Stribeck friction, torque ripple and drift that the model is not told; it is
recorded for 60 s under the paper's law, then 126 other controllers are predicted from that record
alone and run on the truth (with other noise). Figures: relative error of the predicted rms
tracking error, rank correlation, share of truths within the 90 % band.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from figures import Figure, options, tell
from numpy.typing import NDArray
from scipy import stats

from seamlog.analysis.axis_record import AxisRecord, Drive
from seamlog.analysis.closed_loop import ClosedLoop, Reference, simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.replay.counterfactual import make_scene, predict_many
from seamlog.analysis.replay.figures import rms_mm
from seamlog.analysis.replay.model import identify_model
from seamlog.analysis.stribeck_plant import Ripple, StribeckPlant
from seamlog.contracts import Axis, Controller

SEEDS, QUICK_SEEDS = range(1, 6), range(1, 2)
PERIOD_S, COUNT, LATE = 0.04, 1500, 250
TRUTH = Axis(1.0, 2.14, 0.214, 0.0, 0.257, 0.002, saturation=20.0)
LAW = PaperConfig(surface_slope=4.0, gain=0.257, boundary_layer=0.02, dead_zone_m_s=0.007)
LARGEST_MM = 20.0
MEMBERS = 40

Make = Callable[[], Controller]


@dataclass
class PID:
    """kp e + ki integral(e) + kd e' (+ feed-forward with friction at the reference's sign)."""

    kp: float
    ki: float
    kd: float
    feed_forward: bool
    axis: Axis
    integral: float = 0.0
    state_names = ("integral",)

    def output(self, x_d: float, v_d: float, a_d: float, x: float, v: float) -> float:
        """The command."""
        error = x_d - x
        self.integral = min(max(self.integral + self.ki * error * PERIOD_S, -0.5), 0.5)
        ahead = 0.0
        if self.feed_forward:
            sign = (v_d > 0) - (v_d < 0)
            axis = self.axis
            ahead = axis.inertia * a_d + axis.viscous_friction * v_d + axis.coulomb_friction * sign
        return self.kp * error + self.integral + self.kd * (v_d - v) + ahead

    def state(self) -> tuple[float, ...]:
        """The integral."""
        return (self.integral,)


def reference() -> Reference:
    """50 sin 0.6t + 20 sin(1.1t + 1) mm."""
    t = PERIOD_S * np.arange(COUNT)
    slow, fast = 0.6 * t, 1.1 * t + 1
    return Reference(
        0.05 * np.sin(slow) + 0.02 * np.sin(fast),
        0.03 * np.cos(slow) + 0.022 * np.cos(fast),
        -0.018 * np.sin(slow) - 0.0242 * np.sin(fast),
    )


def other_controllers() -> Iterator[Make]:
    """The paper's law 90 times, PID 36 times."""
    static = TRUTH.static_friction
    for slope, share, layer, speed in product(
        (2.0, 3.0, 4.0, 5.0, 6.0), (0.5, 1.0, 1.5), (0.01, 0.03, 0.08), ("measured", "reference")
    ):
        changed = {"surface_slope": slope, "gain": share * static, "boundary_layer": layer}
        config = LAW.model_copy(update=changed | {"friction_speed": speed})
        yield partial(PaperController, config, TRUTH, PERIOD_S)
    for kp, ki, kd, ahead in product((10, 20, 35), (0, 10, 40), (4, 8), (False, True)):
        yield partial(PID, kp, ki, kd, ahead, TRUTH)


def truly(controller: Controller, seed: int) -> ClosedLoop:
    """A run on the true axis, sub-steps of 1 ms."""
    time_s = PERIOD_S * np.arange(COUNT)
    return simulate(
        controller,
        TRUTH,
        reference(),
        PERIOD_S,
        plant=StribeckPlant(TRUTH, PERIOD_S, 40, Ripple(0.03, 0.01)),
        velocity_noise_m_s=np.random.default_rng(seed).normal(0.0, 5e-4, COUNT),
        disturbance=0.03 * np.sin(2 * np.pi * time_s / 37),
        encoder_step_m=1e-6,
    )


def recorded(seed: int) -> AxisRecord:
    """The record that everything is predicted from."""
    run, asked = truly(PaperController(LAW, TRUTH, PERIOD_S), seed), reference()
    stamp_ns = 40_000_000 * np.arange(COUNT)
    return AxisRecord(
        stamp_ns=stamp_ns,
        log_time_ns=stamp_ns,
        position_m=run.measured_position_m,
        velocity_m_s=run.measured_velocity_m_s,
        reference_m=asked.position_m,
        reference_m_s=asked.velocity_m_s,
        reference_m_s2=asked.acceleration_m_s2,
        command=run.command,
        saturated=run.saturated,
        drive=Drive("N"),
        period_s=PERIOD_S,
    )


@dataclass(frozen=True)
class Outcome:
    """rms tracking errors of the other controllers, mm: true, predicted, band."""

    true: NDArray[np.float64]
    predicted: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @property
    def misses(self) -> NDArray[np.float64]:
        """Relative errors in percent."""
        return np.asarray(100 * np.abs(self.predicted / self.true - 1))

    @property
    def covered(self) -> float:
        """Share of truths within the band, percent."""
        return 100 * float(np.mean((self.true >= self.low) & (self.true <= self.high)))

    @property
    def rank_correlation(self) -> float:
        """Spearman's."""
        return float(stats.spearmanr(self.true, self.predicted)[0])


def run_seed(seed: int, members: int = MEMBERS) -> Outcome:
    """Record, predict and compare once."""
    record, late, asked = recorded(seed), slice(LATE, None), reference()
    makes = list(other_controllers())
    true = np.array(
        [
            rms_mm(truly(make(), 1000 * seed + place).tracking_error_m(asked)[late])
            for place, make in enumerate(makes)
        ]
    )
    model = identify_model(record, None)
    model = replace(model, axis=replace(model.axis, saturation=TRUTH.saturation))
    found = predict_many(makes, make_scene(record, model), members, seed)
    rows = np.arange(COUNT) >= LATE
    judged = np.array([(*run.band(rms_mm, rows), run.best(rms_mm, rows)) for run in found])
    counted = true < LARGEST_MM
    low, high, predicted = judged[counted].T
    return Outcome(true[counted], predicted, low, high)


def figures(outcomes: list[Outcome]) -> list[Figure]:
    """The figures of all seeds together; rank correlation and coverage also at their worst."""
    misses = np.concatenate([outcome.misses for outcome in outcomes])
    ranks = [outcome.rank_correlation for outcome in outcomes]
    covered = [outcome.covered for outcome in outcomes]
    return [
        Figure("seeds", len(outcomes), ""),
        Figure("controllers counted", len(misses) / len(outcomes), "a seed"),
        Figure("rms error predicted, median miss", float(np.median(misses)), "%", "<= 4"),
        Figure("rms error predicted, 90th pct", float(np.quantile(misses, 0.9)), "%", "<= 15"),
        Figure("rank correlation, mean", float(np.mean(ranks)), "", ">= 0.98"),
        Figure("rank correlation, least", min(ranks), ""),
        Figure("truth within 90 % band, at least", float(np.mean(covered)), "%", ">= 85"),
        Figure("truth within 90 % band, at most", float(np.mean(covered)), "%", "<= 95"),
        Figure("least coverage of a seed", min(covered), "%"),
        Figure("largest coverage of a seed", max(covered), "%"),
    ]


def main() -> None:
    """Run the seeds and tell."""
    asked = options(__doc__)
    seeds = QUICK_SEEDS if asked.quick else SEEDS
    members = MEMBERS // 2 if asked.quick else MEMBERS
    outcomes = [run_seed(seed, members) for seed in seeds]
    tell("Counterfactual: 126 other controllers from one record", figures(outcomes), asked.json)


if __name__ == "__main__":
    main()
