"""Identification: the axis bench for the online estimators, and the EMPS record where it is.

Axis bench: 60 s of 100 sin t mm under the paper's law at 40 ms, 0.5 mm/s speed noise, 5 seeds.
EMPS (SEAMLOG_DATA, else ../shared/data): the published tables, the chosen model, simulations.
"""

import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from figures import Figure, cpu_s, options, tell
from numpy.typing import NDArray

from seamlog import plugins
from seamlog.analysis.axis_record import AxisRecord, Drive, load_axis_record
from seamlog.analysis.closed_loop import ClosedLoop, Reference, simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.identification.gated import identify_gated
from seamlog.analysis.identification.identify import select_axis_model
from seamlog.analysis.identification.idim_ls import IdimSettings, identify_idim_ls
from seamlog.analysis.identification.output_error import identify_output_error, with_lag
from seamlog.analysis.identification.servo import Servo, fit_servo, replay_error
from seamlog.cli import run
from seamlog.contracts import Axis, Estimator
from seamlog.session import open_session

PROJECT = Path(__file__).resolve().parent.parent
PERIOD_S, COUNT = 0.04, 1500
AXIS = Axis(1.0, 2.14, 0.214, 0.0, 0.257, 0.002, saturation=20.0)
TRUTH = np.array([1.0, 2.14, 0.214])
LAW = PaperConfig(surface_slope=4.0, gain=0.257, boundary_layer=0.02, dead_zone_m_s=0.007)
ESTIMATORS = ("gated_rls", "kalman", "ekf", "ukf")
SYMMETRIC = "95.1089 203.5034 20.3935 -3.1648 0.1085 1.1460 0.1012 0.0444 25.9883 108.7569 4.0834"
ASYMMETRIC = "95.1540 166.7061 20.1440 240.4236 20.6277 3.1117"


def bench_run(seed: int) -> ClosedLoop:
    time_s = PERIOD_S * np.arange(COUNT)
    sine, cosine = 0.1 * np.sin(time_s), 0.1 * np.cos(time_s)
    return simulate(
        PaperController(LAW, AXIS, PERIOD_S),
        AXIS,
        Reference(sine, cosine, -sine),
        PERIOD_S,
        velocity_noise_m_s=5e-4 * np.random.default_rng(seed).standard_normal(COUNT),
        encoder_step_m=1e-6,
    )


def as_record(loop: ClosedLoop) -> AxisRecord:
    stamp_ns = 40_000_000 * np.arange(COUNT)
    none = np.full(COUNT, np.nan)
    return AxisRecord(
        stamp_ns,
        stamp_ns,
        loop.measured_position_m,
        loop.measured_velocity_m_s,
        none,
        none,
        none,
        loop.command,
        loop.saturated,
        Drive("N"),
        PERIOD_S,
    )


def estimates(estimator: Estimator, loop: ClosedLoop) -> NDArray[np.float64]:
    """Parameters over the truth after each sample, shape (n, 3)."""
    before = [0.0, *loop.applied_command[:-1].tolist()]
    motion = loop.measured_position_m.tolist(), loop.measured_velocity_m_s.tolist()
    rows = []
    for seen in zip(*motion, before, strict=True):
        estimator.update(*seen)
        rows.append(estimator.parameters())
    return np.array(rows) / TRUTH


def make(name: str, **tuning: Any) -> Estimator:
    factory = plugins.load("seamlog.estimators", name)
    estimator: Estimator = factory(factory.Config(**tuning), PERIOD_S)
    return estimator


def online(loops: list[ClosedLoop]) -> Iterator[Figure]:
    for name in ESTIMATORS:
        errors = [100 * np.abs(estimates(make(name), loop) - 1) for loop in loops]
        yield Figure(f"{name}: a, b, C, worst after 60 s", worst(errors, -1), "%", "<= 1")
        yield Figure(f"{name}: worst from 6 s on", worst(errors, round(6 / PERIOD_S)), "%", "<= 5")
    for gain in (1.0, 1e3, 1e6):
        error = 100 * np.abs(estimates(make("gated_rls", initial_gain=gain), loops[0]) - 1)
        largest = float(error[round(5 / PERIOD_S) :].max())
        yield Figure(f"gated_rls: initial gain {gain:g}, worst from 5 s on", largest, "%", "<= 200")
    taken_s = cpu_s(lambda: estimates(make("gated_rls"), loops[0]))
    yield Figure("gated_rls: times real time", 60.0 / taken_s, "")


def worst(errors: list[NDArray[np.float64]], start: int) -> float:
    return max(float(error[start:].max()) for error in errors)


def offline(loops: list[ClosedLoop]) -> Iterator[Figure]:
    fits = [identify_gated(as_record(loop)).fit for loop in loops]
    share = np.array([fit.values[:3] / TRUTH - 1 for fit in fits])
    away = np.array([(fit.values[:3] - TRUTH) / fit.sd[:3] for fit in fits])
    yield Figure("gated: a, b, C, worst after 60 s", 100 * float(np.abs(share).max()), "%", "<= 1")
    yield Figure("gated: largest distance in deviations", float(np.abs(away).max()), "sd", "<= 3")


def printed(loops: list[ClosedLoop]) -> Iterator[Figure]:
    """The paper's form after many passes: biased; as printed b is (1 - lambda_f) a larger."""
    for name, ratio in zip(("a", "b", "C"), settled(loops[0]) / TRUTH, strict=True):
        yield Figure(f"paper's filtered form, settled: {name} over truth", float(ratio), "")
    sharp = settled(loops[0], dead_zone_m_s=1e-5)
    literal = settled(loops[0], dead_zone_m_s=1e-5, form="as_printed", speed_unit="mm/s")
    predicted = (1 - (1 - 0.97) / PERIOD_S) * float(sharp[0])
    differs = 100 * abs(float(literal[1] - sharp[1]) / predicted - 1)
    yield Figure("as printed: shift of b from the predicted one", differs, "%", "<= 10")


def settled(loop: ClosedLoop, **tuning: Any) -> NDArray[np.float64]:
    """Parameters after 40 passes over the run: stable gains of explicit Euler are slow ones."""
    gains = {"initial_gain": 20.0, "gain_bound": 100.0, "forgetting_rate": 0.02}
    estimator = make("paper", **gains, **tuning)
    before = [0.0, *loop.applied_command[:-1].tolist()]
    for _ in range(40):
        for velocity, command in zip(loop.measured_velocity_m_s.tolist(), before, strict=True):
            estimator.update(0.0, velocity, command)
    return np.array(estimator.parameters())


def emps(path: Path) -> Iterator[Figure]:
    with open_session(path) as session:
        record = load_axis_record(session)
    yield from published(record)
    chosen = select_axis_model(record).chosen
    settings = with_lag(IdimSettings(), chosen.lag_periods)
    error = identify_idim_ls(record, chosen.friction, settings).fit.relative_error
    name = f"EMPS: {chosen.friction}, lag {chosen.lag_periods:g} ms: relative force error"
    yield Figure(name, 100 * error, "%", "<= 2.3")
    yield from simulated(record, chosen.friction, settings)
    published_law = Servo(160.18, 243.45, window=2, delay_periods=0, relative_error=0.0)
    floor = 100 * replay_error(record, published_law)
    yield Figure("EMPS: commands recomputed, published gains", floor, "%", "<= 0.2385")
    servo = fit_servo(record)
    yield Figure("EMPS: delay of the recomputed commands", abs(servo.delay_periods), "ms", "<= 0")
    yield Figure("EMPS: kp told by the record", servo.position_gain_1_s, "1/s")
    yield Figure("EMPS: kv told by the record", servo.velocity_gain, "V s/m")


def published(record: AxisRecord) -> Iterator[Figure]:
    fit = identify_idim_ls(record).fit
    told = [*fit.values, *fit.white_sd, fit.condition_number, fit.residual_norm]
    yield differing("EMPS: IDIM-LS table", [*told, 100 * fit.relative_error], SYMMETRIC)
    fit = identify_idim_ls(record, "asymmetric").fit
    yield differing("EMPS: asymmetric table", [*fit.values, 100 * fit.relative_error], ASYMMETRIC)


def differing(name: str, values: list[float], table: str) -> Figure:
    wrong = sum(f"{value:.4f}" != text for value, text in zip(values, table.split(), strict=True))
    return Figure(f"{name}: numbers that differ in a printed digit", wrong, "", "<= 0")


def simulated(record: AxisRecord, friction: Any, settings: IdimSettings) -> Iterator[Figure]:
    loop = identify_output_error(record, friction, settings).extras["closed_loop"]
    for name, target in (("position", 0.002), ("velocity", 0.13), ("force", 3.8)):
        value = loop[f"{name}_error"]
        yield Figure(f"EMPS: closed loop simulated, {name}", value, "%", f"<= {target}")
    alone = identify_output_error(record, friction, settings, "open")
    rms_mm = alone.extras["open_loop"]["position_rms_mm"]
    count = len(alone.fit.names)
    yield Figure(f"EMPS: open loop simulated, {count} numbers, rms", rms_mm, "mm", "<= 1.6")


def emps_figures() -> Iterator[Figure]:
    data = Path(os.environ.get("SEAMLOG_DATA") or PROJECT.parent / "shared" / "data")
    log, mapping = data / "emps" / "DATA_EMPS.mat", PROJECT / "examples" / "emps.map.toml"
    if not log.is_file():
        sys.stderr.write(f"EMPS left out: no {log}\n")
        return
    with TemporaryDirectory() as folder:
        path = Path(folder) / "emps.mcap"
        with redirect_stdout(io.StringIO()):
            run(["import", str(log), "--map", str(mapping), "-o", str(path)])
        yield from emps(path)


def main() -> None:
    chosen = options(__doc__)
    loops = [bench_run(seed) for seed in range(1 if chosen.quick else 5)]
    parts: list[Callable[[list[ClosedLoop]], Iterator[Figure]]] = [online, offline, printed]
    figures = [figure for part in parts for figure in part(loops)]
    tell("Identification", [*figures, *emps_figures()], chosen.json)


if __name__ == "__main__":
    main()
